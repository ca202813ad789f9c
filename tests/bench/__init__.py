"""`make bench`: what the daemon costs beside its peers, and the rig. Measures and prints; asserts nothing."""
