"""What a daemon runs with, as records; wrcd/config/config.py makes them from a TOML file."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from wrcd.bus.dbc import Database
from wrcd.bus.signals import Output, Source
from wrcd.core.design import Design

# Of the design's. With the true load on the bus, the interval of nominal conditions still holds the truth in 77 %
# of the frames at 0.7 and 1.3 (89 % at 1.0, 67 % at 0.6): beyond, a design for that load is needed.
LOAD_SHARES = (0.7, 1.3)
# A wheel wears by less than a tenth of its radius; as far, the interval still holds the truth in 85 % and more.
RADIUS_SHARES = (0.9, 1.1)
MAX_WHEELBASES = 1.6  # of the design: what stands further apart shares no bogie; another vehicle's bogie still does


AXLE_OUTPUTS = ("adhesion", "detail", "inputs", "own")  # keys of an axle's messages


@dataclass(frozen=True, slots=True)
class AxleConfig:
    """One wheelset: its number (1 … MAX_AXLES) and the messages that tell about it."""

    number: int
    adhesion: Output
    detail: Output | None
    inputs: Output | None
    own: Output | None = None
    position_m: float | None = None  # along the train, forward positive; None: not known

    @property
    def sent(self) -> tuple[Output | None, ...]:
        """The messages, in the order of AXLE_OUTPUTS."""
        return tuple(getattr(self, kind) for kind in AXLE_OUTPUTS)


@dataclass(frozen=True, slots=True)
class Input:
    """A mapped signal and after how long without it it is stale."""

    source: Source
    timeout_us: int


@dataclass(frozen=True, slots=True)
class RecorderConfig:
    """The flight recorder: seconds of frames in memory (0: none), and how much its folder (None: none) may hold."""

    folder: Path | None
    seconds: float
    max_files: int  # dumps; each is a log and its events
    max_mb: float

    @property
    def on(self) -> bool:
        """Whether there is anything to record for."""
        return self.folder is not None and self.seconds > 0


@dataclass(frozen=True, slots=True)
class Config:
    """All that the daemon runs with."""

    file: str
    interface: str
    channel: str
    hardware_stamps: bool
    dbc_file: Path
    database: Database
    design_file: Path
    design: Design
    axles: tuple[AxleConfig, ...]
    inputs: tuple[Input, ...]
    data_ids: Mapping[str, int | None]  # of E2E, by message that carries inputs (None: not protected)
    status: Output | None
    rejects: Output | None
    link: Output | None
    not_available_after_us: int
    min_speed_m_s: float
    constant_speed_m_s: float | None
    fuses: bool  # words of axles on one rail: where they stand, how fast the train is and which way it runs is known
    torque_is_total: bool
    recorder: RecorderConfig
    warnings: tuple[str, ...] = ()  # what is odd, but bearable

    @property
    def bogies(self) -> tuple[tuple[int, int], ...]:
        """Places of axles that share a bogie, the leading one first: of neighbours two by two, but of those whose
        positions are known only the near ones; a lone wheelset's neighbours run on one track wherever they are."""
        most_m = MAX_WHEELBASES * self.design.wheelbase_m if self.design.is_bogie else math.inf
        at = [math.nan if a.position_m is None else a.position_m for a in self.axles]
        step = 2 if any(map(math.isnan, at)) else 1
        off = [abs(abs(a - b) - self.design.wheelbase_m) for a, b in itertools.pairwise(at)]
        out, k = list[tuple[int, int]](), 0
        while k + 1 < len(at):
            is_next = step == 1 and k + 2 < len(at) and off[k + 1] < off[k]  # the next two are the bogie's
            is_pair = not is_next and not abs(at[k] - at[k + 1]) > most_m
            out += [(k, k + 1)] if is_pair else []
            k += 2 if is_pair else step
        return tuple(out)
