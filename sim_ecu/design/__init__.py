"""Makes the design file, and the reference engine that checks the one on the train."""
