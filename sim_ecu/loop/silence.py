"""When a message falls silent and is heard again: what of it is told, how often and how long it was silent."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

EVERY_US = 1_000_000  # between two silences of a message that are told, if they are short
LONG_US = 200_000  # a silence that lasts so long is always told
SILENT = "demand silent for 30 ms: traction ends, brakes apply as the driver asked"
NONE_YET = "no demand yet: no traction, brakes apply as the driver asks"


class News(Enum):
    """What is told of a message."""

    NONE_YET = 0
    SILENT = 1
    HEARD = 2  # for the first time
    AGAIN = 3


@dataclass(slots=True)
class Silence:
    """Of one message, looked at in every cycle. That it has not come yet is no silence."""

    cycle_us: int
    silences: int = 0
    silent_us: int = 0  # all of them
    longest_us: int = 0
    heard: bool = False
    lasted_us: int = 0  # the newest one
    _since_us: int | None = None
    _told: bool = False
    _told_us: int = -EVERY_US

    @property
    def now(self) -> bool:
        """Whether it is silent."""
        return self._since_us is not None

    def look(self, now_us: int, silent: bool) -> News | None:
        """What there is to tell at the end of a cycle in which it was silent or not."""
        if not silent:
            return self._end()
        news = None
        if self._since_us is None:
            self._since_us, self._told = now_us - self.cycle_us, False
            self.silences += self.heard
        self.lasted_us = now_us - self._since_us
        if self.heard:
            self.silent_us += self.cycle_us
            self.longest_us = max(self.longest_us, self.lasted_us)
        if not self._told and (now_us - self._told_us >= EVERY_US or self.lasted_us >= LONG_US):
            self._told, self._told_us = True, now_us
            news = News.SILENT if self.heard else News.NONE_YET
        return news

    def _end(self) -> News | None:
        was_silent, self._since_us = self._since_us is not None, None
        news = None if not was_silent or not self._told else News.AGAIN if self.heard else News.HEARD
        self.heard = True
        return news

    def counts(self) -> dict[str, Any]:
        """Whether it ever came, how often it fell silent, how long in all and at most."""
        return {
            "heard": self.heard, "silences": self.silences, "silent_s": round(self.silent_us * 1e-6, 3),
            "longest_s": round(self.longest_us * 1e-6, 3),
        }  # fmt: skip


class DemandSilences:
    """Of the demands of some axles."""

    def __init__(self, axles: Sequence[int], cycle_us: int) -> None:
        self.by_axle = {n: Silence(cycle_us) for n in axles}

    def look(self, now_us: int, silent: Sequence[bool | None]) -> list[str]:
        """The lines of what there is to tell after a sample in which each axle's demand was silent or not; None: it was
        too early to say."""

        def text(news: News, s: Silence) -> str:
            if news in (News.SILENT, News.NONE_YET):
                return SILENT if news is News.SILENT else NONE_YET
            return f"demand {'again' if news is News.AGAIN else 'heard'} after {s.lasted_us * 1e-6:.2f} s"

        told = (
            (n, s, s.look(now_us, is_silent))
            for (n, s), is_silent in zip(self.by_axle.items(), silent, strict=True)
            if is_silent is not None
        )
        grouped = together(((str(n), s, news) for n, s, news in told if news is not None), text)
        return [f"axle{'s' * (len(names) > 1)} {', '.join(names)}: {what}" for what, names in grouped.items()]

    @property
    def now(self) -> list[int]:
        """The axles whose demand is silent."""
        return [n for n, s in self.by_axle.items() if s.now]


def together(
    told: Iterable[tuple[str, Silence, News]], text: Callable[[News, Silence], str]
) -> dict[str, list[str]]:  # fmt: skip
    """The names of which the same is told, by what that is."""
    out: dict[str, list[str]] = {}
    for name, s, news in told:
        out.setdefault(text(news, s), []).append(name)
    return out
