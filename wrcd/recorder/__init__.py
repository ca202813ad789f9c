"""The flight recorder: a ring of frames, and the process that writes a dump of it."""
