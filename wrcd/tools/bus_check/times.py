"""How long each axle was Valid, and how long not, by cause."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.events import Change


@dataclass(slots=True)
class Spells:
    """What an axle said, in µs. details: by cause, how it was when it was given for longest."""

    valid_us: int = 0
    causes_us: dict[Cause, int] = field(default_factory=dict)
    details: dict[Cause, str] = field(default_factory=dict)
    longest_us: dict[Cause, int] = field(default_factory=dict)

    @property
    def all_us(self) -> int:
        """All of it."""
        return self.valid_us + sum(self.causes_us.values())

    def share(self, cause: Cause) -> float:
        """Of all of it."""
        return self.causes_us.get(cause, 0) / self.all_us if self.all_us else 0.0


class Clock:
    """Follows a core's changes of Validity."""

    def __init__(self, core: Core, config: Config) -> None:
        self._core, self._seen = core, 0
        self.axles: Mapping[int, Spells] = {a.number: Spells() for a in config.axles}
        self._newest: dict[int, Change] = {}

    def look(self) -> None:
        """Take down what has changed. Often enough: a core keeps only so many changes."""
        for change in self._core.events.since(self._seen):
            self._end(change.axle, change.time_us)
            self._newest[change.axle] = change
        self._seen = self._core.events.total

    def end(self) -> None:
        """The last frame has come."""
        self.look()
        for axle in self.axles:
            self._end(axle, self._core.time_us or 0)

    def _end(self, axle: int, time_us: int) -> None:
        """What an axle has said until now is over."""
        before = self._newest.get(axle)
        if before is None:
            return
        spells, lasted = self.axles[axle], max(0, time_us - before.time_us)
        if before.after is Validity.VALID:
            spells.valid_us += lasted
        else:
            spells.causes_us[before.cause] = spells.causes_us.get(before.cause, 0) + lasted
            if lasted >= spells.longest_us.get(before.cause, 0):
                spells.longest_us[before.cause], spells.details[before.cause] = lasted, before.detail
