"""Kits for tests: trains with odd messages, compilers, and an independent reading of the same frames."""
