"""What happened so far: what the core counts, and what it knows of the loop and the link."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Literal

from wrcd.bus.link import LinkHealth
from wrcd.bus.reasons import Reason

State = Literal["Running", "LinkDown", "Stopping"]


@dataclass(slots=True)
class Counts:
    """What happened so far. Every mapped frame is in accepted or in rejected under its reason."""

    accepted: int = 0
    rejected: Counter[Reason] = field(default_factory=Counter)
    # the same by message, for the log
    rejected_by_message: Counter[tuple[str, Reason]] = field(default_factory=Counter)
    # measurements at an end of their range, which were not used, by axle (its number) and quantity in words; likewise
    clipped: Counter[tuple[int, str]] = field(default_factory=Counter)
    late: int = 0  # arrived after their tick was closed: used in the tick that was open
    time_steps: int = 0
    restarts: int = 0  # axles started anew: absurd measurements that went on, a speed that jumped
    ticks: int = 0
    last_reason: str = "None"  # label of the newest rejection's

    def reject(self, message: str, reason: Reason) -> None:
        """A frame of a message was not accepted."""
        self.rejected[reason] += 1
        self.rejected_by_message[message, reason] += 1
        self.last_reason = reason.label

    @property
    def rejections(self) -> str:
        """The rejections by reason, for a person."""
        return ", ".join(f"{n} {reason}" for reason, n in sorted(self.rejected.items())) or "none"

    @property
    def clippings(self) -> str:
        """The clipped measurements by axle and quantity, for a person."""
        named = (f"{n} axle {axle} {quantity}" for (axle, quantity), n in sorted(self.clipped.items()))
        return ", ".join(named) or "none"

    @property
    def seen(self) -> int:
        """All mapped frames."""
        return self.accepted + self.rejected.total()


@dataclass(slots=True)
class Health:
    """What the loop knows and the core sends in WrcdStatus and WrcdLink."""

    state: State = "Running"
    overruns: int = 0
    link: LinkHealth = field(default_factory=LinkHealth)
