"""What of all that would stop Valid, what only deserves a look, and the page that says so."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wrcd.bus.dbc import find_message
from wrcd.bus.frame import counted_ids, id_text
from wrcd.bus.units import Quantity
from wrcd.core.causes import OF_ESTIMATE, OF_PAIR, OF_RIDE, Cause, Validity
from wrcd.core.coarse_sensors import cost_of_step
from wrcd.core.configuration import Config
from wrcd.core.design_fit import UNSURE, DesignFit
from wrcd.dbc.bus_check.input_figures import Gathered, SignalFigures
from wrcd.dbc.bus_check.signs import Fit
from wrcd.logs.story_records import Spells

OF_PLACES = (*OF_PAIR, *OF_ESTIMATE)  # what a sound bus gives in places, too: doubts, a start anew
MAX_SHARE, MAX_SHARE_OF_PLACES, MIN_SHARE = 0.01, 0.1, 0.005
START_S = 0.1  # until every input has come for the first time
MAX_CYCLE_ERROR = 0.1
MAX_REFUSED, MAX_AT_LIMIT = 0.001, 0.001
MAX_STEPS = 1.0  # a converter's step over the noise that the design was made with
MAX_NOISE = 4.0  # times that noise; a wrong unit is more
MEASURED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)


@dataclass(frozen=True, slots=True)
class BusFinding:
    """stops: whether it would stop Valid."""

    stops: bool
    where: str
    text: str


def findings(
    config: Config, gathered: Gathered, found: Sequence[SignalFigures], fits: Sequence[Fit],
    spells: Mapping[int, Spells],
) -> list[BusFinding]:  # fmt: skip
    """The gravest first."""
    out = [*_silent(config, gathered), *_spells(config, gathered, spells)]
    out += [BusFinding(True, f.what, f.text) for f in fits if f.fits is False]
    for f in found:
        out += [BusFinding(False, f.name, text) for text in _odd(config, f)]
    if gathered.errors:
        out.append(BusFinding(False, "bus", f"{gathered.errors} error frames"))
    return sorted(out, key=lambda f: not f.stops)


def _silent(config: Config, gathered: Gathered) -> list[BusFinding]:
    """Messages of which not one frame came."""
    out = []
    gone = [place for place in range(len(config.axles)) if not _came(config, gathered, place)]
    if gone:
        numbers = ", ".join(str(config.axles[place].number) for place in gone)
        out.append(BusFinding(True, f"axle{'s' * (len(gone) > 1)} {numbers}", "not one frame of their own came"))
    named = set()
    for number, i in enumerate(config.inputs):
        name = i.source.message
        if gathered.carries_none(number):
            text = "its message comes, but not one frame that carries it: what selects it?"
            out.append(BusFinding(True, f"{name}.{i.source.signal}", text))
        if gathered.frames[name] or name in named or set(i.source.axles) <= set(gone):
            continue
        named.add(name)
        m = find_message(config.database, name)
        kind = "extended id" if m.is_extended_frame else "id"
        out.append(BusFinding(True, f"{name}.{i.source.signal}", f"not one frame of {kind} 0x{m.frame_id:X} came"))
    return out


def _came(config: Config, gathered: Gathered, place: int) -> bool:
    """Whether anything came that is of this axle, and not of all."""
    own = [i.source.message for i in config.inputs if place in i.source.axles and i.source.quantity in MEASURED]
    return any(gathered.frames[name] for name in own)


def _spells(config: Config, gathered: Gathered, spells: Mapping[int, Spells]) -> list[BusFinding]:
    """What the core itself found of its axles."""
    out = []
    for place, axle in enumerate(config.axles):
        if not _came(config, gathered, place):
            continue
        s = spells[axle.number]
        begun = s.events[0] if s.events and s.events[0].duration_s < START_S else None
        for cause, share in s.shares.items():
            later = share - begun.duration_s / s.known_s if begun and begun.cause is cause else share
            if cause in OF_RIDE or not cause or later < MIN_SHARE:
                continue
            stops = share >= (MAX_SHARE_OF_PLACES if cause in OF_PLACES else MAX_SHARE)
            also = "; a speed in a wrong unit looks the same" if cause is Cause.ACCEL_SMALL else ""
            text = f"{cause.label} in {100 * share:.1f} % of {s.known_s:.1f} s: {s.longest(cause)}{also}"
            out.append(BusFinding(stops, f"axle {axle.number}", text))
        if not s.lasted_s(Validity.VALID) and not any(f.stops for f in out if f.where == f"axle {axle.number}"):
            why = "the train is too slow" if s.shares.get(Cause.STANDSTILL, 0.0) > 0.5 else "too short to tell"
            out.append(BusFinding(True, f"axle {axle.number}", f"never Valid in {s.known_s:.1f} s: {why}"))
    return out


def _odd(config: Config, f: SignalFigures) -> list[str]:
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
    if measured and f.at_limit > 0:
        out.append(
            f"{100 * f.at_limit:.2g} % of its values are clipped at an end of its range: no part of the estimate"
        )
    elif f.at_limit > MAX_AT_LIMIT:
        out.append(f"{100 * f.at_limit:.1f} % of its values stand at an end of its range")
    if measured:
        design = float(config.design.noise_rms[int(f.quantity == Quantity.LAT_ACCEL.key)])
        if f.step > MAX_STEPS * design:
            out.append(
                f"a step of {f.step:.2g} {f.unit} is {f.step / design:.1f} times the noise of the design's sensor: "
                + cost_of_step(f.step / design)
            )
        elif f.noise > MAX_NOISE * design:
            out.append(
                f"its noise of {f.noise:.2g} {f.unit} is {f.noise / design:.1f} times that of the design's sensor: "
                "vibration, or its unit or scale is wrong"
            )
    return out


HEAD = (
    "signal",
    "of",
    "per s",
    "cycle",
    "usual",
    "jitter",
    "longest / time-out",
    "refused",
    "range",
    "step / noise",
    "at limit",
)


def page(
    config: Config, gathered: Gathered, found: Sequence[SignalFigures], fits: Sequence[Fit],
    spells: Mapping[int, Spells], findings: Sequence[BusFinding], bogies: Sequence[DesignFit],
) -> list[str]:  # fmt: skip
    """Lines."""
    stops = [f for f in findings if f.stops]
    number = len(stops)
    out = [f"{number} finding{'s' * (number > 1)} would stop Valid or make it wrong" if stops else _fine(fits, bogies)]
    out += [f"  {f.where}: {f.text}" for f in stops]
    looks = [f for f in findings if not f.stops]
    if looks:
        out += ["worth a look", *(f"  {f.where}: {f.text}" for f in looks)]
    out += ["", f"{gathered.mapped} mapped frames in {gathered.seconds:.1f} s, {_others(gathered)}"]
    if number := len(gathered.gaps.begin_us):
        gone_s = gathered.gaps.total_us * 1e-6
        out.append(
            f"{number} gap{'s' * (number > 1)} of {gone_s:.1f} s in all without any frame: no part of what follows"
        )
    out.append("")
    out += _table(HEAD, [_row(f) for f in found if f.frames])
    out += ["", "signs"]
    out += [f"  {f.what}: {_word(f)}; {f.text}" for f in fits] or ["  nothing to tell them by"]
    out.append("time")
    for axle in (a for a in config.axles if any(f.frames and f.axles == (a.number,) for f in found)):
        out.append(f"  axle {axle.number}: {_lasted(spells[axle.number])}")
    name = config.design.wheelset.get("name", config.design.name)
    if not bogies:
        out.append(f"wheelset  the design is for {name!r}; whether the train has it, the signals cannot tell")
        return out
    return [*out, f"wheelset  the design is for {name!r}", *(f"  {b.sentence}" for b in bogies)]


def design_findings(bogies: Sequence[DesignFit], slides: str) -> list[BusFinding]:
    """Bogies that are not, or not surely, the design's; and what slides say against it, or nothing."""
    hint = "make one for it: `sim-ecu calibrate`, then `sim-ecu design`"
    found = [b for b in bogies if b.word in ("Unlike", "Unsure")]
    return [
        BusFinding(b.word == "Unlike", "wheelset", f"{b.sentence}; {hint}" if b.ratio >= UNSURE else b.sentence)
        for b in found
    ] + [BusFinding(False, "wheelset", f"{slides}; {hint}")] * bool(slides)


def _fine(fits: Sequence[Fit], bogies: Sequence[DesignFit]) -> str:
    """The verdict where nothing stops Valid, with what could not be seen."""
    unseen = sum(f.fits is None for f in fits)
    signs = [f"{unseen} of {len(fits)} signs"] if unseen else [] if fits else ["any sign"]
    vehicle = [] if bogies and all(b.word == "Like" for b in bogies) else ["whether the vehicle is that of the design"]
    unknown = [*signs, *vehicle]
    but = f". They do not tell {' and '.join(unknown)}" if unknown else ""
    return f"fine in what the signals tell: nothing would stop Valid{but}"


def nothing(config: Config, gathered: Gathered) -> list[str]:
    """The page where no frame fits."""
    ids = ", ".join(sorted({id_text(key) for key in gathered.receiver.mapped.keys}))
    return [
        f"no frame of {gathered.seconds:.1f} s fits the configuration ({config.file}): it maps {ids}",
        f"{_others(gathered)} came",
    ]


def _others(gathered: Gathered) -> str:
    n = gathered.others.total()
    if not n:
        return "none of other ids"
    return f"{n} of other ids ({counted_ids(gathered.others)})"


def _word(f: Fit) -> str:
    return {True: "fits", False: "DOES NOT FIT", None: "not known"}[f.fits]


def _lasted(s: Spells) -> str:
    if not s.events:
        return "nothing was reported"
    parts = [f"Valid {100 * s.share(Validity.VALID):.1f} %"]
    parts += [f"{cause.label} {100 * share:.1f} %" for cause, share in s.shares.items() if cause]
    return f"{', '.join(parts)} of {s.known_s:.1f} s"


def _row(f: SignalFigures) -> tuple[str, ...]:
    def ms(x: float) -> str:
        return f"{x:.1f}" if math.isfinite(x) else "–"

    of = f"{f.quantity} {','.join(map(str, f.axles))}"
    seen = f"{f.low:.4g} … {f.high:.4g} {f.unit}" if math.isfinite(f.low) else "–"
    fine = " / ".join(f"{x:.2g}" if math.isfinite(x) else "–" for x in (f.step, f.noise))
    limit = f"{100 * f.at_limit:.1f} %" if math.isfinite(f.at_limit) else "–"
    return (
        f.name, of, f"{f.per_s:.1f}", f"{f.cycle_ms} ms" if f.cycle_ms else "–", ms(f.usual_ms), ms(f.jitter_ms),
        f"{ms(f.longest_ms)} / {f.timeout_ms:g}", f"{100 * f.refused_share:.1f} %", seen, fine, limit,
    )  # fmt: skip


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in (head, *rows)
    ]
