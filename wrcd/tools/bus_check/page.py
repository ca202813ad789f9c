"""The report for a person: the verdict first, then what it is made from."""

import math
from collections.abc import Mapping, Sequence

from wrcd.core.configuration import Config
from wrcd.tools.bus_check.figures import Figures
from wrcd.tools.bus_check.findings import Finding
from wrcd.tools.bus_check.gather import Gathered
from wrcd.tools.bus_check.signs import Fit
from wrcd.tools.bus_check.times import Spells

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
MAX_OTHERS = 8


def page(
    config: Config, gathered: Gathered, found: Sequence[Figures], fits: Sequence[Fit], spells: Mapping[int, Spells],
    findings: Sequence[Finding],
) -> list[str]:  # fmt: skip
    """Lines."""
    stops = [f for f in findings if f.stops]
    number = len(stops)
    out = [
        "fine: nothing would stop Valid"
        if not stops
        else f"{number} finding{'s' * (number > 1)} would stop Valid or make it wrong"
    ]
    out += [f"  {f.where}: {f.text}" for f in stops]
    looks = [f for f in findings if not f.stops]
    if looks:
        out += ["worth a look", *(f"  {f.where}: {f.text}" for f in looks)]
    out += ["", f"{gathered.mapped} mapped frames in {gathered.seconds:.1f} s, {_others(gathered)}", ""]
    out += _table(HEAD, [_row(f) for f in found if f.frames])
    out += ["", "signs"]
    out += [f"  {f.what}: {_word(f)}; {f.text}" for f in fits] or ["  nothing to tell them by"]
    out.append("time")
    for axle in (a for a in config.axles if any(f.frames and f.axles == (a.number,) for f in found)):
        out.append(f"  axle {axle.number}: {_spells(spells[axle.number])}")
    name = config.design.wheelset.get("name", config.design.name)
    out.append(f"wheelset  the design is for {name!r}; a foreign one is told by its signals only in part")
    return out


def nothing(config: Config, gathered: Gathered) -> list[str]:
    """What is said where no frame fits."""
    ids = ", ".join(sorted({_id(key) for key in gathered.receiver.readers}))
    return [
        f"no frame of {gathered.seconds:.1f} s fits the configuration {config.file}: it maps {ids}",
        f"there are {_others(gathered)}",
    ]


def _others(gathered: Gathered) -> str:
    n = gathered.others.total()
    if not n:
        return "nobody else's"
    most = ", ".join(f"{_id(key)} {count}" for key, count in gathered.others.most_common(MAX_OTHERS))
    more = ", …" if len(gathered.others) > MAX_OTHERS else ""
    return f"{n} of {len(gathered.others)} other ids ({most}{more})"


def _id(key: int) -> str:
    return f"0x{key & 0x1FFF_FFFF:08X}" if key >> 31 else f"0x{key:03X}"


def _word(f: Fit) -> str:
    return {True: "fits", False: "DOES NOT FIT", None: "not told"}[f.fits]


def _spells(s: Spells) -> str:
    if not s.all_us:
        return "nothing was said"
    parts = [f"Valid {100 * s.valid_us / s.all_us:.1f} %"]
    parts += [f"{c.label} {100 * s.share(c):.1f} %" for c in sorted(s.causes_us, key=lambda c: -s.causes_us[c]) if c]
    return f"{', '.join(parts)} of {s.all_us * 1e-6:.1f} s"


def _row(f: Figures) -> tuple[str, ...]:
    def ms(x: float) -> str:
        return f"{x:.1f}" if math.isfinite(x) else "–"

    of = f"{f.quantity} {','.join(map(str, f.axles))}"
    seen = f"{f.low:.4g} … {f.high:.4g} {f.unit}" if math.isfinite(f.low) else "–"
    fine = f"{f.step:.2g} / {f.noise:.2g}" if math.isfinite(f.noise) else f"{f.step:.2g} / –"
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
