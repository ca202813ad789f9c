"""The kinds of job that there are, a module each: a job's key hashes what its own imports."""
