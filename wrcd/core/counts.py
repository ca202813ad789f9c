"""What happened so far: what the core counts, and what it knows of the loop and the link."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from wrcd.bus.link import LinkHealth
from wrcd.bus.mapping import Mapped
from wrcd.bus.reasons import Reason
from wrcd.core.configuration import Config
from wrcd.core.layouts import as_struct

State = Literal["Running", "LinkDown", "Stopping"]
REASONS: tuple[Reason | None, ...] = (None, *Reason)  # by their number in C


class Counts:
    """What a core has counted. Every mapped frame is in accepted or in rejected under its reason."""

    def __init__(self, config: Config, mapped: Mapped, state: Any) -> None:
        """state: the core's records."""
        self._messages, self._inputs = state["message_state"], state["input_state"]
        self._core = as_struct(state["core"])
        self._names = [m.name for m in mapped.messages]
        numbers = [a.number for a in config.axles]
        self._clipped_of = [
            (k, [numbers[place] for place in s.source.axles], s.source.quantity.words)
            for k, s in enumerate(mapped.signals)
        ]

    @property
    def accepted(self) -> int:
        """Frames that were accepted."""
        return int(self._core.accepted)

    @property
    def late(self) -> int:
        """Arrived after their tick was closed: used in the tick that was open."""
        return int(self._core.late)

    @property
    def time_steps(self) -> int:
        """Steps of time."""
        return int(self._core.time_steps)

    @property
    def restarts(self) -> int:
        """Axles started anew: absurd measurements that went on, a speed that jumped."""
        return int(self._core.restarts)

    @property
    def waits(self) -> int:
        """How often an axle that was reset again and again had to wait."""
        return int(self._core.waits)

    @property
    def ticks(self) -> int:
        """Ticks that were closed."""
        return int(self._core.ticks)

    @property
    def last_reason(self) -> str:
        """The label of the newest rejection's reason."""
        reason = REASONS[self._core.last_reason]
        return "None" if reason is None else reason.label

    @property
    def rejected(self) -> Counter[Reason]:
        """Frames that were not accepted, by reason."""
        return self._by_reason(self._messages["refused"][: len(self._names)].sum(axis=0).tolist())

    @property
    def rejected_by_message(self) -> Counter[tuple[str, Reason]]:
        """The same by message, for the log."""
        refused = self._messages["refused"]
        return Counter({
            (name, reason): n
            for k, name in enumerate(self._names) if refused[k].any()
            for reason, n in self._by_reason(refused[k].tolist()).items()
        })  # fmt: skip

    @staticmethod
    def _by_reason(counts: Sequence[int]) -> Counter[Reason]:
        return Counter({reason: n for reason, n in zip(REASONS, counts, strict=True) if reason is not None and n})

    @property
    def clipped(self) -> Counter[tuple[int, str]]:
        """Measurements at an end of their range, which were not used, by axle (its number) and quantity in words."""
        found: Counter[tuple[int, str]] = Counter()
        clipped = self._inputs["clipped"].tolist()
        for k, numbers, words in self._clipped_of:
            for number in numbers if clipped[k] else ():
                found[number, words] += clipped[k]
        return found

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
        return int(self._core.accepted + self._core.refused)


@dataclass(slots=True)
class Health:
    """What the loop knows and the core sends in WrcdStatus and WrcdLink."""

    state: State = "Running"
    overruns: int = 0
    link: LinkHealth = field(default_factory=LinkHealth)
