"""A DBC as a person reads it: its text with lines, and what its names look like. For init and lint."""
