"""What of all that would stop Valid, and what only deserves a look."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wrcd.bus.dbc import find_message
from wrcd.bus.units import Quantity
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.tools.bus_check.figures import Figures
from wrcd.tools.bus_check.gather import Gathered
from wrcd.tools.bus_check.signs import Fit
from wrcd.tools.bus_check.times import Spells

OF_COURSE = (Cause.WARMING_UP, Cause.STANDSTILL)  # no fault of bus or configuration
# What a sound bus gives in places, too: a doubt of a pair of sensors or of an estimate, a start anew.
OF_PLACES = frozenset((Cause.RESTARTED, *range(Cause.SENSORS_SILENT, Cause.CONTRADICTION + 1)))
MAX_SHARE, MAX_SHARE_OF_PLACES, MIN_SHARE = 0.01, 0.1, 0.005
MAX_CYCLE_ERROR = 0.1
MAX_REFUSED, MAX_AT_LIMIT = 0.001, 0.001
MAX_STEPS = 4.0  # a converter's step over the noise that the design was made with
MAX_NOISE = 4.0  # times that noise; a wrong unit is more
MEASURED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)


@dataclass(frozen=True, slots=True)
class Finding:
    """stops: whether it would stop Valid."""

    stops: bool
    where: str
    text: str


def findings(
    config: Config, gathered: Gathered, found: Sequence[Figures], fits: Sequence[Fit], spells: Mapping[int, Spells],
    wheelset: str | None,
) -> list[Finding]:  # fmt: skip
    """The gravest first. wheelset: what is said against the design's."""
    out = [*_silent(config, gathered), *_spells(config, gathered, spells)]
    out += [Finding(True, f.what, f.text) for f in fits if f.fits is False]
    for f in found:
        out += [Finding(False, f.name, text) for text in _odd(config, f)]
    if wheelset is not None:
        out.append(Finding(False, "wheelset", wheelset))
    if gathered.errors:
        out.append(Finding(False, "bus", f"{gathered.errors} error frames"))
    return sorted(out, key=lambda f: not f.stops)


def _silent(config: Config, gathered: Gathered) -> list[Finding]:
    """Messages of which not one frame came."""
    out = []
    gone = [place for place in range(len(config.axles)) if not _came(config, gathered, place)]
    if gone:
        numbers = ", ".join(str(config.axles[place].number) for place in gone)
        out.append(Finding(True, f"axle{'s' * (len(gone) > 1)} {numbers}", "not one frame of their own came"))
    said = set()
    for i in config.inputs:
        name = i.source.message
        if gathered.frames[name] or name in said or set(i.source.axles) <= set(gone):
            continue
        said.add(name)
        m = find_message(config.database, name)
        kind = "extended id" if m.is_extended_frame else "id"
        out.append(Finding(True, f"{name}.{i.source.signal}", f"not one frame of {kind} 0x{m.frame_id:X} came"))
    return out


def _came(config: Config, gathered: Gathered, place: int) -> bool:
    """Whether anything came that is of this axle, and not of all."""
    own = [i.source.message for i in config.inputs if place in i.source.axles and i.source.quantity in MEASURED]
    return any(gathered.frames[name] for name in own)


def _spells(config: Config, gathered: Gathered, spells: Mapping[int, Spells]) -> list[Finding]:
    """What the core itself said of its axles."""
    out = []
    for place, axle in enumerate(config.axles):
        if not _came(config, gathered, place):
            continue
        s = spells[axle.number]
        causes = sorted(s.causes_us, key=lambda c: -s.causes_us[c])
        for cause in causes:
            share = s.share(cause)
            if cause in OF_COURSE or not cause or share < MIN_SHARE:
                continue
            stops = share >= (MAX_SHARE_OF_PLACES if cause in OF_PLACES else MAX_SHARE)
            text = f"{cause.label} in {100 * share:.1f} % of {s.all_us * 1e-6:.1f} s: {s.details[cause]}"
            out.append(Finding(stops, f"axle {axle.number}", text))
        if not s.valid_us and not any(f.stops for f in out if f.where == f"axle {axle.number}"):
            why = "the train is too slow" if s.share(Cause.STANDSTILL) > 0.5 else "too short to tell"
            out.append(Finding(True, f"axle {axle.number}", f"never Valid in {s.all_us * 1e-6:.1f} s: {why}"))
    return out


def _odd(config: Config, f: Figures) -> list[str]:
    """What of a signal deserves a look."""
    out = []
    if f.cycle_ms and abs(f.usual_ms - f.cycle_ms) > MAX_CYCLE_ERROR * f.cycle_ms:
        out.append(f"comes every {f.usual_ms:.1f} ms, its DBC says {f.cycle_ms}")
    if f.longest_ms > f.timeout_ms:
        out.append(f"longest gap {f.longest_ms:.1f} ms, time-out {f.timeout_ms:g}")
    tick_ms = 1000 * config.design.tick_s
    measured = f.quantity in {q.key for q in MEASURED}
    if measured and f.usual_ms > 1.5 * tick_ms:
        out.append(f"comes every {f.usual_ms:.1f} ms, the estimator's tick is {tick_ms:g} ms")
    if f.refused_share > MAX_REFUSED:
        reasons = ", ".join(f"{n} {reason}" for reason, n in sorted(f.refused.items()))
        out.append(f"{100 * f.refused_share:.1f} % of its frames are refused: {reasons}")
    if f.at_limit > MAX_AT_LIMIT:
        out.append(f"{100 * f.at_limit:.1f} % of its values stand at an end of its range")
    if measured:
        design = float(config.design.noise_rms[int(f.quantity == Quantity.LAT_ACCEL.key)])
        if f.step > MAX_STEPS * design:
            out.append(
                f"a step of {f.step:.2g} {f.unit} is {f.step / design:.1f} times the noise of the design's sensor"
            )
        elif f.noise > MAX_NOISE * design:
            out.append(
                f"its noise of {f.noise:.2g} {f.unit} is {f.noise / design:.1f} times that of the design's sensor: "
                "vibration, or its unit or scale is wrong"
            )
    return out
