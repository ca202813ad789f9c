"""The fault matrix as data: for every kind of fault, what Adhesion of the axle must do."""

from dataclasses import dataclass

from sim_ecu.play.faults import ALL, KINDS, SILENT, Fault

SLOT_MS = 20  # an adhesion frame tells of the time up to its slot's beginning
TIMEOUT_MS = {"yaw_rate": 15, "lateral_acceleration": 15, "torque": 30, "speed": 60, ALL: 15}
CYCLE_MS = {"yaw_rate": 5, "lateral_acceleration": 5, "torque": 10, "speed": 20, ALL: 10}
WINDOW_MS, LONGEST_WINDOW_MS = 1000, 2000
LONG_S = 3.0
IDENTITY_S = 12.0
# The longest window and a little after any fault, seen or not, the estimate must be what it would have been, but for
# so much.
SETTLED_AFTER_MS, SETTLED_PP = LONGEST_WINDOW_MS + 150, 1.0


@dataclass(frozen=True, slots=True)
class Leaves:
    """Not Valid from within_ms after the fault's begin on until its end; Valid again back_ms after the end."""

    within_ms: float
    back_ms: float

    def __str__(self) -> str:
        return f"leave Valid in {self.within_ms:g} ms, be back in {self.back_ms:g} ms"


@dataclass(frozen=True, slots=True)
class Stays:
    """Valid throughout, MuAvailable at most so far from that without the fault."""

    within_pp: float

    def __str__(self) -> str:
        return f"stay Valid within {self.within_pp:g} pp"


@dataclass(frozen=True, slots=True)
class Found:
    """Not Valid from within_ms after the fault's begin on until its end, and for as long again: that is not judged."""

    within_ms: float

    def __str__(self) -> str:
        return f"be found out in {self.within_ms / 1000:g} s"


@dataclass(frozen=True, slots=True)
class Unseen:
    """Nothing on the bus tells of it. How far the estimate goes astray is measured, not judged."""

    def __str__(self) -> str:
        return "cannot be seen"


Must = Leaves | Stays | Found | Unseen


@dataclass(frozen=True, slots=True)
class Row:
    """A fault (its at_s is the player's) and what must come of it."""

    fault: Fault
    must: Must


def _row(kind: str, of: str, must: Must, duration_s: float = 0.5, amount: float | None = None) -> Row:
    return Row(Fault(kind, 0.0, duration_s, of, 1, amount), must)


def _leaves(of: str, noticed_ms: float = 0.0, forgotten_ms: float = 0.0) -> Leaves:
    """A time-out and a slot after the last good frame; a window after the second good one (of the first after a fault
    the counter may be refused), the next slot. And what it takes to notice the fault, and that it is over."""
    return Leaves(TIMEOUT_MS[of] + noticed_ms + SLOT_MS, WINDOW_MS + 2 * CYCLE_MS[of] + forgotten_ms + SLOT_MS)


def _two_senders(of: str) -> Leaves:
    """A second sender is suspected at its second frame, and forgotten after one turn of the counter."""
    return _leaves(of, forgotten_ms=15 * CYCLE_MS[of])


_ONE_AND_ALL = ("yaw_rate", ALL)
_REFUSED = ("burst", "crc", "counter", "dlc", "nan", "status", "swap")
ROWS = (
    *(_row(kind, of, _leaves(of)) for kind in _REFUSED for of in _ONE_AND_ALL),
    *(_row(kind, of, _leaves(of)) for kind in ("burst", "status") for of in ("torque", "speed")),
    # a sender that says Degraded, and then Ok: the estimate is a window old
    *(_row("status", of, _leaves(of), amount=1.0) for of in (*_ONE_AND_ALL, "speed")),
    # the first frame of a freeze is still true
    *(_row("freeze", of, _leaves(of, noticed_ms=CYCLE_MS["yaw_rate"])) for of in _ONE_AND_ALL),
    *(_row("sender", of, _two_senders(of)) for of in _ONE_AND_ALL),
    *(_row(kind, ALL, _leaves(ALL)) for kind in SILENT),
    *(_row("loss", of, Stays(1.0)) for of in _ONE_AND_ALL),
    *(_row("burst", of, Stays(1.0), 0.01) for of in _ONE_AND_ALL),  # two frames, the most that may be missing
    *(_row("spike", of, Stays(1.0)) for of in _ONE_AND_ALL),
    *(_row("babble", of, Stays(0.1)) for of in _ONE_AND_ALL),
    _row("error-flood", ALL, Stays(0.0)),
    # a step far beyond what the track does: nothing that was known before holds; and the step back is noticed likewise
    *(_row("bias", of, _leaves(of, forgotten_ms=3 * CYCLE_MS["yaw_rate"])) for of in _ONE_AND_ALL),
    _row("bias", "speed", _leaves("speed", forgotten_ms=CYCLE_MS["speed"])),
    _row("bias", "yaw_rate", Unseen(), amount=0.01),
    _row("drift", "yaw_rate", Stays(1.0), LONG_S, 0.0002),
    *(_row("drift", of, Unseen()) for of in _ONE_AND_ALL),
    *(_row("delay", of, Unseen()) for of in _ONE_AND_ALL),
    *(_row("dead", of, Unseen()) for of in _ONE_AND_ALL),
    *(_row("swap-wiring", of, Unseen(), LONG_S) for of in _ONE_AND_ALL),
    _row("bias", "torque", Unseen()),
    _row("freeze", "torque", Unseen()),
)
# What shows in the sensors' signals only after seconds, and is doubted for as long afterwards: on the virtual
# clock alone.
# Ten full seconds, judged once a second, at the end of a quarter of a second.
_PAIR = Found(11_250.0 + SLOT_MS)
_SECOND = Found(1500.0 + SLOT_MS)  # of noise alone, both or one beside a loud one, and until it is judged
LONG_ROWS = (
    _row("dead", ALL, _SECOND, LONG_S),
    *(_row("reverse", of, _PAIR, IDENTITY_S) for of in ("yaw_rate", "lateral_acceleration")),
    *(_row("dead", of, _SECOND, IDENTITY_S) for of in ("yaw_rate", "lateral_acceleration")),
    _row("swap-wiring", "yaw_rate", _PAIR, IDENTITY_S),
)


def missing() -> set[str]:
    """Kinds of fault that no row is about."""
    return set(KINDS) - {r.fault.kind for r in (*ROWS, *LONG_ROWS)}
