"""What the daemon costs by axles, rate and bus load: the table of docs/reference/cost.md."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tests.bench.timing import Times
from tests.bench.workload import LENGTH_US, TICK_US, stretch
from wrcd.config.config import load_config

TICKS_S = 1e6 / TICK_US
RATES = (200, 1000)  # ticks a second
KBIT_S = 500.0


@dataclass(frozen=True, slots=True)
class Traffic:
    """Frames a second by the bytes that they carry."""

    frames: dict[int, float]

    @property
    def rate(self) -> float:
        return sum(self.frames.values())

    def load(self, kbit_s: float, stuffed: bool) -> float:
        """Share of a bus of classical frames with standard ids, without stuff bits or with as many as there can be."""
        bits = sum(rate * _bits(size, stuffed) for size, rate in self.frames.items())
        return bits / (1e3 * kbit_s)


def _bits(size: int, stuffed: bool) -> int:
    # start, id, control, CRC, acknowledge, end, and three bits between frames; the first 34 and the data are stuffed
    return 47 + 8 * size + ((34 + 8 * size - 1) // 4 if stuffed else 0)


def received(axles: int) -> Traffic:
    """What the sensors of so many axles send."""
    out: dict[int, float] = {}
    for r in stretch(axles):
        out[len(r.data)] = out.get(len(r.data), 0.0) + 1e6 / LENGTH_US
    return Traffic(out)


def sent(axles: int) -> Traffic:
    """What the daemon sends: of each axle Adhesion, AdhesionDetail and InputHealth, and three frames of its own."""
    c = load_config(None)
    first = c.axles[0]
    per_axle = sum(1e6 / o.cycle_us for o in (first.adhesion, first.detail, first.inputs) if o)
    return Traffic({8: axles * per_axle + sum(1e6 / o.cycle_us for o in (c.status, c.rejects, c.link) if o)})


def table(core_us: Sequence[tuple[int, Times]]) -> Iterator[str]:
    """Markdown. One line for each number of axles that was measured."""
    rates = "".join(f" share at {rate} ticks/s |" for rate in RATES)
    yield f"| axles | frames/s in | frames/s out | bus load at {KBIT_S:g} kbit/s | core, µs a tick |{rates}"
    yield "|---|---|---|---|---|" + "---|" * len(RATES)
    for axles, times in core_us:
        into, out = received(axles), sent(axles)
        low, high = (100 * (into.load(KBIT_S, s) + out.load(KBIT_S, s)) for s in (False, True))
        shares = "".join(f" {100e-6 * times.median * rate:.1f} % |" for rate in RATES)
        yield f"| {axles} | {into.rate:.0f} | {out.rate:.0f} | {low:.0f} … {high:.0f} % | {times.median:.0f} |{shares}"
