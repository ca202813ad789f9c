"""Which signal carries what, and how: what the configuration says of signals, over what their DBC says."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field

from wrcd.bus.units import Quantity


@dataclass(frozen=True, slots=True)
class StatusRule:
    """A signal that says whether its sender is well. A raw value that is in neither set refuses the frame."""

    message: str
    signal: str
    ok: frozenset[int]
    degraded: frozenset[int]
    timeout_us: int = 0  # of a status in another message than what it is about: past it nothing is known


@dataclass(frozen=True, slots=True)
class Source:
    """Which signal carries a quantity, of which axles (places 0 … n-1, all of them for the vehicle's own).

    None, everywhere: as the DBC says. A physical value is raw * scale + offset; a quantity in SI units at the axle is
    physical * factor, sign and gear ratio included.
    """

    message: str
    signal: str
    quantity: Quantity
    axles: tuple[int, ...]
    _: KW_ONLY
    scale: float | None = None
    offset: float | None = None
    factor: float | None = None
    low: float | None = None  # physical
    high: float | None = None
    invalid: frozenset[int] = frozenset()  # raw values that are no measurement, besides those that the DBC names so
    statuses: tuple[StatusRule, ...] = ()
    reverse: frozenset[int] | None = None  # raw values of a direction that mean reverse
    part: int = 0  # 0 … of the signals that add up to the quantity
    pgn: bool = False  # its message is any frame of the parameter group (J1939), whoever sends it


@dataclass(frozen=True, slots=True)
class OutputSignal:
    """How a value of ours is sent. None: as the DBC says."""

    name: str
    factor: float = 1.0  # from our unit to the signal's
    words: Mapping[str, int] | None = None  # our word -> raw value
    not_available: int | None = None  # raw value
    round_down: bool = False
    low: float | None = None  # physical: what may be sent
    high: float | None = None


@dataclass(frozen=True, slots=True)
class Output:
    """A message to send: which of its signals carry what, by our names. A value without a signal is left out."""

    message: str
    cycle_us: int
    data_id: int | None  # of E2E Profile 11; None: not protected
    signals: Mapping[str, OutputSignal] = field(default_factory=dict)
