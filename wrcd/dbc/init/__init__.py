"""`wrcd init`: a configuration proposed for a train's DBC, with what a person must settle."""
