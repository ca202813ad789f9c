"""What is to be designed, from a rig's TOML file."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu.design.cases import KINDS
from sim_ecu.design.linear import Point
from sim_ecu.design.make import Brief, in_papers_form
from sim_ecu.physics.contact import CURVES, CreepCurve
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.scenario_keys import TITLE
from sim_ecu.play.vehicles import DEFAULT_VEHICLE, read_origin, read_vehicle, vehicle_path
from wrcd.config.describe import made_for
from wrcd.config.keys import Choice, Number, Whole
from wrcd.config.settings import Section, read_toml
from wrcd.core.design import FORMS, Design, load_design
from wrcd.core.terms import SPAN_TICKS, PairState, Regime
from wrcd.errors import InputError
from wrcd.logs.rule_sentences import GLOSSARY, bounds, sentence
from wrcd.resources import LONE


@dataclass(frozen=True, slots=True)
class Recipe:
    """A loaded design with the inputs it was made from, and how well its rules describe their own training data.

    seed and roughness (times the good track's spectral density, from … to) are of the training conditions; support is
    how many windows speak for each rule; windows and mean_error_pp are of the fit.
    """

    file: Path
    design: Design
    wheelset: Wheelset
    sensors: SensorSet
    points: tuple[Point, ...]
    seed: int
    roughness: tuple[float, float]
    support: tuple[float, ...]
    windows: int
    mean_error_pp: float


def load_source(file: Path) -> Recipe:
    """Read a design file for the rig. Raises InputError where it lacks what the rig needs."""
    design = load_design(file)
    document: Any = json.loads(file.read_text(encoding="utf-8"))
    try:
        inputs, plan, fit = document["inputs"], document["inputs"]["plan"], document["fit"]
        low, high = plan["roughness_range"]
        return Recipe(
            file=file,
            design=design,
            wheelset=Wheelset.of(design.wheelset),
            sensors=SENSOR_SETS[inputs["sensors"]["name"]],
            points=tuple(_point(m) for m in document["bank"]["models"]),
            seed=int(plan["seed"]),
            roughness=(float(low), float(high)),
            support=tuple(float(s) for s in document["fuzzy"]["support"]),
            windows=int(fit["windows"]),
            mean_error_pp=float(fit["mean_error_pp"]),
        )
    except (KeyError, TypeError, ValueError) as e:
        raise InputError(
            f"lacks what the rig needs of it: {e!r}",
            file=file,
            key="inputs",
            hint="make the design again with `sim-ecu design`",
        ) from None


def _point(m: dict[str, Any]) -> Point:
    track, yaw, lateral = (float(q) for q in m["noise"])
    return Point(
        str(m["name"]), CreepCurve(**m["curve"]), float(m["creep_of_peak"]), (track, yaw, lateral),
        float(m["yaw_rate_weight"]),
    )  # fmt: skip


def explain(file: Path) -> int:
    """Print wheelset, worlds, models, sets, and the rules: those that most of the training data supports first."""
    source = load_source(file)
    design, support = source.design, source.support
    whole = sum(support)
    print(f"{design.name}, checksum {design.checksum[:12]}: {len(design.rules)} rules over {source.windows} windows of "
          f"{design.window_s:g} s (seed {source.seed}), mean error on them {source.mean_error_pp} pp")  # fmt: skip
    print(f"For the wheelset {made_for(design)}")
    if design.worlds:
        print("\nThe worlds that it was trained in:")
        for world in design.worlds:
            print(f"  {world}")
    print("\nModels, and where each is linearised:")
    for k, p in enumerate(source.points):
        print(f"  {k + 1}: {p.name} (curve {p.curve.name}, mu_0 {p.curve.mu_0:.3g}, {p.creep_of_peak:.3g} of the creep "
              f"at its peak)")  # fmt: skip
    print("\nThe middles of the sets; between two of them an input belongs to both:")
    for line in bounds(design):
        print(f"  {line}")
    if design.slopes.any():
        print("\nWhat the outputs move with, besides:")
        for line in GLOSSARY:
            print(f"  {line}")
    print("\nRules. The outcome is their mean by weight; output 0 … 100 is converted to adhesion by the polynomial.")
    for r in sorted(range(len(support)), key=lambda r: -support[r]):
        low, high = design.typical_pct[r]
        print(f"{r + 1:3}. {sentence(design, r)}\n"
              f"     {support[r]:.0f} windows' worth ({100 * support[r] / whole:.1f} %), nine tenths of them at "
              f"{low:.3g} … {high:.3g} %; 90 % interval ± {100 * design.spreads[r]:.0f} % of the estimate")  # fmt: skip
    for line in (*_widening(design), *_judging(design)):
        print(line)
    return 0


def _widening(design: Design) -> Iterator[str]:
    if (model := design.interval) is not None:
        yield (
            "\nWhat the interval's width is multiplied by, at "
            + ", ".join(f"{v:g}" for v in model.speeds_m_s)
            + " m/s:"
        )
        for of, row in zip(Regime, model.factors, strict=True):
            yield f"  {of.words}: " + ", ".join(f"{factor:.2f}" for factor in row)


def _judging(design: Design) -> Iterator[str]:
    if (model := design.health) is not None:
        span_s = SPAN_TICKS * design.tick_s
        yield (
            f"\nWhat a pair of sensors may be. Every {span_s:g} s a network of {len(model.hidden_bias)} hidden units "
            f"says how much likelier each is than a sound pair; of the log odds {model.kept:g} are kept:"
        )
        for state, share, prior in zip(PairState, model.temper, model.log_prior, strict=True):
            if state:
                yield f"  {state.words}: {share:.2f} of the evidence counts, odds of e^{prior:.1f} at first"


POLYNOMIALS = ("fitted", "paper")
LINEAR = 0.02  # of the peak's creep: up to here a curve is straight
# least and most of [design] and of [plan]
NUMBERS = {
    "tick_s": (0.001, 0.02), "window_s": (0.1, 10.0), "longest_s": (0.1, 20.0), "recent_s": (0.02, 10.0),
    "band_hz": (2.0, 40.0), "saturated_share": (0.1, 1.0),
}  # fmt: skip
WHOLES = {"grid": (2, 500), "torque_sets": (2, 15), "max_rules": (1, 254)}
# the score's seeds are far above
PLAN_NUMBERS = {"own_weight": (0.1, 10.0), "covers_still": (0.5, 0.99), "covers_moved": (0.5, 0.99)}
PLAN_WHOLES = {"seed": (0, 1_000), "speeds": (2, 200), "per_speed": (2, 2_000)}


@cache
def of_a_train() -> Brief:
    """What a bogie's brief has where its file says nothing: the default vehicle's."""
    return read_brief(read_toml(vehicle_path(DEFAULT_VEHICLE)), base=Brief())


def read_brief(top: Section, form: str | None = None, base: Brief | None = None) -> Brief:
    """[wheelset], [design] and [plan] of a rig's TOML file; what is not there is as in the base, or else the default,
    which depends on the vehicle and on the form: as given, or else the file's."""
    d, p = top.section("design"), top.section("plan")
    wheelset = read_vehicle(top)
    form_of_file = Choice("form", "", FORMS, FORMS[0]).value(d)
    if (form or form_of_file) == "paper":
        base = in_papers_form(Brief())
    elif base is None:
        base = Brief() if wheelset.bogie is None else of_a_train()
    plan = base.plan
    numbers = _given(Number, d, NUMBERS, base)
    if base.form == "paper" and "longest_s" not in d:
        numbers["longest_s"] = numbers["window_s"]
    shares = _given(Number, p, {f"{kind}_share": (0.0, 1.0) for kind in KINDS}, plan)
    weights = _given(Number, p, PLAN_NUMBERS, plan)
    if sum(shares.values()) > 1.0:
        raise p.error(f"shares add up to {sum(shares.values()):g}; they must not exceed 1", next(iter(shares)))
    brief = replace(
        base,
        wheelset=wheelset,
        origin=read_origin(top),
        **numbers,
        **_given(Whole, d, WHOLES, base),
        polynomial=Choice("polynomial", "", ("paper",) if base.form == "paper" else POLYNOMIALS, base.polynomial).value(
            d
        ),
        points=_points(d, base.points),
        plan=replace(
            plan,
            **_given(Whole, p, PLAN_WHOLES, plan),
            **shares,
            **weights,
            sensors=Choice("sensors", "", tuple(SENSOR_SETS), plan.sensors).value(p),
        ),
    )
    if brief.longest_s < brief.window_s:
        raise d.error(f"must not be less than window_s = {brief.window_s:g}, is {brief.longest_s:g}", "longest_s")
    if brief.form == "wrcd" and brief.longest_s < SPAN_TICKS * brief.tick_s:
        least = SPAN_TICKS * brief.tick_s
        raise d.error(f"must be {least:g} or more, the span that sensors are judged by", "longest_s")
    if brief.form == "paper" and brief.longest_s > brief.window_s:
        raise d.error(f"must be window_s = {brief.window_s:g}: windows do not grow in the paper's form", "longest_s")
    if 2 * brief.recent_s > brief.window_s:
        raise d.error(f"must not be more than half of window_s = {brief.window_s:g}, is {brief.recent_s:g}", "recent_s")
    TITLE.read(top)  # a packaged vehicle has one
    for section in (d, p, top):
        section.done()
    return brief


def _given(
    kind: type[Number] | type[Whole], section: Section, ends: Mapping[str, tuple[Any, Any]], base: object
) -> dict[str, Any]:
    return {n: kind(n, "", low, high, getattr(base, n)).value(section) for n, (low, high) in ends.items()}


def _points(d: Section, points: tuple[Point, ...]) -> tuple[Point, ...]:
    """The four models with what the file gives them: curves by their letters, creep as a share of the peak's, and the
    noise as `sim-ecu design --search` writes it, three and a weight each."""
    letters, creeps = d.raw("curves"), d.raw("creep_of_peak")
    if letters is not None:
        if not isinstance(letters, list) or len(letters) != len(points) or not set(map(str, letters)) <= set(CURVES):
            raise d.error(f"takes {len(points)} letters of {', '.join(CURVES)}", "curves", 'e.g. ["A", "C", "D", "B"]')
        points = tuple(moved(p, CURVES[c], p.creep_of_peak) for p, c in zip(points, letters, strict=True))
    if creeps is not None:
        if not isinstance(creeps, list) or len(creeps) != len(points) or not all(map(_is_creep, creeps)):
            raise d.error(f"takes {len(points)} numbers above 0 and up to 5", "creep_of_peak", "1 is the peak")
        points = tuple(moved(p, p.curve, float(c)) for p, c in zip(points, creeps, strict=True))
    rows = d.raw("noise")
    if rows is None:
        return points
    try:
        table = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        table = np.empty(0)
    if table.shape != (len(points), 4) or not np.all((table > 0) & (table < 1e6)) or np.any(table[:, 3] >= 2):
        raise d.error(
            f"takes {len(points)} rows of four positive numbers, the last of each below 2", "noise",
            "of each model: three noises per root Hz and the yaw rate's weight; `sim-ecu design --search` writes it",
        )  # fmt: skip
    return tuple(
        replace(p, noise=(row[0], row[1], row[2]), yaw_rate_weight=row[3])
        for p, row in zip(points, table.tolist(), strict=True)
    )


def _is_creep(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value <= 5.0


def moved(p: Point, curve: CreepCurve, creep_of_peak: float) -> Point:
    """A point elsewhere, with the name of where it is."""
    if (curve, creep_of_peak) == (p.curve, p.creep_of_peak):
        return p
    where = " at its peak" if creep_of_peak == 1.0 else f" at {creep_of_peak:g} of its peak's creep"
    where = ", linear region" if creep_of_peak <= LINEAR else where
    return replace(p, name=f"curve {curve.name}{where}", curve=curve, creep_of_peak=creep_of_peak)


def written(brief: Brief, comments: Sequence[str] = ()) -> str:
    """The brief as a file for `--config`. Raises no error: what read_brief does not read keeps its default there."""
    w, plan, points = brief.wheelset, brief.plan, brief.points
    shares = {name: getattr(plan, name) for name in (*(f"{kind}_share" for kind in KINDS), *PLAN_NUMBERS)}
    fields = {"name": w.name, **w.numbers()}
    lines = [f"# {c}" for c in comments]
    if w.bogie is None:
        lines += [f"vehicle = {json.dumps(LONE)}"]
    else:
        del fields["M_v"]  # it follows from the masses
        lines += ["[vehicle]", *(f"{name} = {json.dumps(value)}" for name, value in asdict(w.bogie).items())]
    lines += ["", "[wheelset]", *(f"{name} = {json.dumps(value)}" for name, value in fields.items())]
    lines += ["", "[design]"]
    lines += [f"{name} = {json.dumps(getattr(brief, name))}" for name in ("form", *NUMBERS, *WHOLES, "polynomial")]
    lines += [
        f"curves = {json.dumps([p.curve.name for p in points])}",
        f"creep_of_peak = {json.dumps([p.creep_of_peak for p in points])}",
        "# of each model: y_t' (m/s), yaw and lateral acceleration (rad/s2, m/s2), per root Hz; the yaw rate's weight",
        "noise = [", *(f"    {json.dumps([*p.noise, p.yaw_rate_weight])},  # {p.name}" for p in points), "]",
        *(["", "[origin]"] if brief.origin else []),
        *(f"{name} = {json.dumps(value)}" for name, value in brief.origin.items()),
        "", "[plan]", *(f"{name} = {json.dumps(getattr(plan, name))}" for name in PLAN_WHOLES),
        *(f"{name} = {json.dumps(value)}" for name, value in shares.items()), f"sensors = {json.dumps(plan.sensors)}",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"
