"""The wheel-rail condition daemon: what runs on the train."""
