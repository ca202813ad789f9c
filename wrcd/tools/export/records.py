"""What an exported file holds: groups of channels that have their time stamps in common, and rows of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

UNKNOWN_WORD = "unknown"  # for a word that is none of ours

Column = NDArray[np.float64] | NDArray[np.int8] | list[str]


@dataclass(frozen=True, slots=True)
class Channel:
    """A signal by our name. With words its values are places in them, -1 for another word; text is text."""

    name: str
    unit: str = ""
    words: tuple[str, ...] = ()
    is_text: bool = False
    comment: str = ""


@dataclass(frozen=True, slots=True)
class Group:
    """Channels of one message, of one quantity, or of what is told of an axle."""

    name: str
    channels: tuple[Channel, ...]
    comment: str = ""
    of: str = ""  # whose: "_A1"; it ends the name, and each signal's where names must differ over a whole file


@dataclass(frozen=True, slots=True)
class Rows:
    """Of one group, in the order of their time: columns as its channels, each (n,). NaN: there is no value."""

    group: Group
    time_us: NDArray[np.int64]
    columns: Sequence[Column]


@dataclass(frozen=True, slots=True)
class About:
    """Whose values a file holds."""

    begin_us: int  # the log's first frame
    facts: Mapping[str, str]  # program, design, log, …

    @property
    def text(self) -> str:
        """A line for each fact."""
        return "\n".join(f"{name}: {fact}" for name, fact in self.facts.items())


class Exporter(Protocol):
    """Writes one file."""

    def begin(self, about: About) -> None:
        """Say whose values will come."""

    def write(self, rows: Sequence[Rows]) -> None:
        """Write some seconds of the log: groups with what they have of it."""

    def close(self) -> None:
        """Finish the file."""
