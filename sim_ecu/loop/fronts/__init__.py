"""Fronts over set points: what a law reaches with wrcd and without, however tuned; here the names of the rails."""

RAILS = ("wet", "greasy", "low", "leaf-patch")
