"""Stop at the mark: drivers who choose before the slide how hard to brake, in the worlds of a train."""
