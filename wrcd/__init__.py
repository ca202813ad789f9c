"""The wheel-rail condition daemon: what runs on the train."""

__version__ = "0.4.0"
