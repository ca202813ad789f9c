"""What a daemon runs with, as records; wrcd/config/config.py makes them from a TOML file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from wrcd.bus.dbc import Database
from wrcd.bus.signals import Output, Source
from wrcd.core.design import Design


@dataclass(frozen=True, slots=True)
class AxleConfig:
    """One wheelset: its number (1 … MAX_AXLES) and the messages that tell about it."""

    number: int
    adhesion: Output
    detail: Output | None
    inputs: Output | None


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
    torque_is_total: bool
    recorder: RecorderConfig
    warnings: tuple[str, ...] = ()  # what is odd, but bearable
