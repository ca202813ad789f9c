"""Fusion along the vehicle, scored: patches that are reported before an axle is on them, and false reports."""
