"""The fault matrix: what must come of every kind of fault, and what does."""
