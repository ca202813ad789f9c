"""`wrcd kit`: a receiver in C of the Adhesion frames of a configuration, with its tests and a field table."""
