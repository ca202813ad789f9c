"""The command line: run, check, dump, replay."""
