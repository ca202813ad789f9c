"""Controllers of wheel slide and traction: reference implementations, ordinary participants of the bus."""
