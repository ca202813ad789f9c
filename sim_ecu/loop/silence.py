"""When an axle's demand falls silent and comes again: lines for a person, how often and how long."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from sim_ecu.play.encoder import SAMPLE_US

SILENT = "demand silent for 30 ms: traction ends, brakes apply as the driver asked"
NONE_YET = "no demand yet: no traction, brakes apply as the driver asks"


@dataclass(slots=True)
class _Axle:
    silences: int = 0
    silent_us: int = 0  # all of them
    longest_us: int = 0
    since_us: int | None = None  # of the one that lasts
    heard: bool = False


@dataclass
class Silences:
    """Of some axles; told after each sample whether each is silent. A demand that has not come yet is no silence."""

    axles: Sequence[int]
    _by_axle: dict[int, _Axle] = field(init=False)

    def __post_init__(self) -> None:
        self._by_axle = {n: _Axle() for n in self.axles}

    def look(self, now_us: int, silent: Sequence[bool]) -> list[str]:
        """The lines of what has changed with the sample that ended at now_us."""
        begun: dict[str, list[int]] = {}
        for (n, a), is_silent in zip(self._by_axle.items(), silent, strict=True):
            if not is_silent:
                if a.since_us is not None:
                    # with the sample before it ended
                    lasted_us = now_us - SAMPLE_US - a.since_us
                    again = "again" if a.heard else "heard"
                    begun.setdefault(f"demand {again} after {lasted_us * 1e-6:.2f} s", []).append(n)
                    a.since_us = None
                a.heard = True
            elif a.since_us is None:
                a.since_us = now_us - SAMPLE_US
                begun.setdefault(SILENT if a.heard else NONE_YET, []).append(n)
                a.silences += a.heard
            if is_silent and a.heard and a.since_us is not None:
                a.silent_us += SAMPLE_US
                a.longest_us = max(a.longest_us, now_us - a.since_us)
        return [f"{_axles(numbers)}: {what}" for what, numbers in begun.items()]

    @property
    def now(self) -> list[int]:
        """The axles that are silent now."""
        return [n for n, a in self._by_axle.items() if a.since_us is not None]

    def counts(self) -> dict[int, dict[str, float | int | bool]]:
        """By axle: whether a demand ever came, how often it fell silent, how long in all and at most."""
        return {
            n: {
                "heard": a.heard, "silences": a.silences, "silent_s": round(a.silent_us * 1e-6, 3),
                "longest_s": round(a.longest_us * 1e-6, 3),
            }
            for n, a in self._by_axle.items()
        }  # fmt: skip


def _axles(numbers: Sequence[int]) -> str:
    return f"axle {numbers[0]}" if len(numbers) == 1 else f"axles {', '.join(map(str, numbers))}"
