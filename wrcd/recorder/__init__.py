"""The flight recorder: ring, state and its file, the process that writes a dump."""
