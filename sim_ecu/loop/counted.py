"""Counts in words."""

from collections.abc import Mapping
from typing import Any


def times(n: int) -> str:
    """Once, or so many times."""
    return "once" if n == 1 else f"{n} times"


def counted(rejected: Mapping[str, int]) -> str:
    """Frames that were not taken, by reason; nothing if all were."""
    text = ", ".join(f"{n} {why}" for why, n in rejected.items() if n)
    return f"; frames not taken: {text}" if text else ""


def down(bus: Mapping[str, Any]) -> str:
    """What has become of a bus, of the counts of its end; nothing if nothing has."""
    text = f"; bus down {times(bus['downs'])}, {bus['down_s']:.1f} s" if bus["downs"] else ""
    text += f"; {bus['drops']} frames lost in the kernel's buffer" if bus["drops"] else ""
    return text + (f"; {bus['foreign_frames']} frames under its ids by somebody else" if bus["foreign_frames"] else "")
