"""Makes the design file."""
