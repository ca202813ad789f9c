"""Any DBC to frames and back."""

from wrcd.bus.positions import message_key, position
from wrcd.bus.writers import SignalWriter, Value, Writer

__all__ = ["SignalWriter", "Value", "Writer", "message_key", "position"]
