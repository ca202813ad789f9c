"""Fusion along the vehicle, scored: what is told of a patch before an axle is on it, and what is told for nothing."""
