"""The kinds of job that there are, a module each."""
