"""The running daemon: the only place with a clock, signals and processes."""
