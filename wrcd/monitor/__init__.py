"""`wrcd monitor`: what a daemon says, live or of a log, on a terminal. Read-only."""
