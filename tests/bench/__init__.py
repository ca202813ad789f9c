"""`make bench`: what the daemon costs, beside what its peers cost. Measures and prints; asserts nothing."""
