"""The proposal, key by key: what fits best, what else might, and what the DBC does not say."""

import os
from pathlib import Path

from wrcd import declared, resources
from wrcd.bus.units import Quantity
from wrcd.bus.words import is_reverse
from wrcd.config import mistakes
from wrcd.estimator.design import Design, load_design
from wrcd.section import toml
from wrcd.tools.check import KNOWN_BY
from wrcd.tools.dbc.candidates import Candidate, candidates
from wrcd.tools.dbc.records import DbcText
from wrcd.tools.dbc.vocabulary import TOTAL_WORDS, contains
from wrcd.tools.init.adhesion import propose_adhesion
from wrcd.tools.init.draft import Draft
from wrcd.tools.init.inputs import propose_input, propose_shared
from wrcd.tools.init.numbering import PER_AXLE, Train, arrange, near

NEEDED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE)


def propose(dbc: DbcText, folder: Path, design: Design | None = None) -> Draft:
    """Return the draft of a configuration that lies in a folder.

    design: default the packaged one. Raises InputError where it can't be read.
    """
    design = design or load_design(resources.DESIGN)
    draft = Draft(dbc.file.name)
    train = arrange(candidates(dbc))
    _head(draft, dbc, folder, design)
    draft.add("", "[vehicle]")
    _vehicle(draft, dbc, train, design)
    numbers = sorted(train.axles) or [1]
    for place, number in enumerate(numbers, 1):
        draft.axle = f"axle[{place}]"
        found = train.axles.get(number, {})
        draft.add("", "[[axle]]", f"number = {number}")
        for q in PER_AXLE:
            _one(draft, dbc, train, q, f"axle {number}, {q.key}", found.get(q, []), number, design)
        propose_adhesion(draft, dbc, number, len(numbers))
    _limits(draft)
    draft.refused(mistakes("\n".join(draft.lines), dbc.file, folder, design))
    return draft


def _limits(draft: Draft) -> None:
    """An estimate must not end before an input counts as stale."""
    limit = declared.NOT_AVAILABLE_AFTER
    name, longest = max(draft.timeouts_ms.items(), key=lambda one: one[1], default=("", 0.0))
    if longest <= (limit.default or 0.0):
        return
    about = f"limits, {limit.name}"
    draft.add("", "[limits]")
    line = f"{limit.name} = {longest:g}"
    if longest <= limit.high:
        draft.doubt(about, f"{name} is stale after {longest:g} ms only, and an estimate lasts as long without it")
        draft.add(line)
    else:
        draft.todo(
            about,
            f"{name} has a time-out of {longest:g} ms, more than {limit.high:g}: give it a timeout_ms",
            f"limits.{limit.name}",
        )
        draft.add(f"# {line}")


def _head(draft: Draft, dbc: DbcText, folder: Path, design: Design) -> None:
    draft.add(
        'bus = { interface = "socketcan", channel = "can0" } # where the frames are',
        f"dbc = {{ file = {toml(Path(os.path.relpath(dbc.file, folder)).as_posix())} }}",
        "",
    )
    name = str(design.wheelset.get("name", design.name))
    draft.todo(
        "wheelset",
        f"is it the wheelset {name!r} of the packaged design? The signals of many another one look alike, "
        "and its estimates are wrong. Compare; then take the next line as it is, or name a design for yours under "
        "[estimator].",
        "dbc.file",
    )
    draft.add(f"# wheelset = {{ name = {toml(name)} }}")
    draft.add(f"#   axle load {2e-3 * design.normal_N:.4g} kN")
    for key, what, unit in KNOWN_BY:
        value = design.wheelset.get(key)
        if isinstance(value, int | float):
            draft.add(f"#   {what} {value:g} {unit}".rstrip())


def _vehicle(draft: Draft, dbc: DbcText, train: Train, design: Design) -> None:
    for text in train.doubts:
        draft.doubt("axles", text)
    if train.left_out:
        draft.todo("axles", f"one daemon takes eight; left out: {', '.join(map(str, train.left_out))}", "axle")
    speeds = train.vehicle[Quantity.SPEED]
    if speeds:
        propose_input(draft, dbc, "speed", "vehicle, speed", speeds, design)
    else:
        draft.todo(
            "vehicle, speed",
            "nothing looks like the train's speed: name the signal, or give limits.constant_speed_m_s",
            "vehicle.speed",
        )
        draft.add('# speed = "Message.Signal"')
    for c in train.vehicle[Quantity.DIRECTION][:1]:
        _direction(draft, c)
    _torque_is_total(draft, train)


def _direction(draft: Draft, c: Candidate) -> None:
    told = [w for _, w in (c.signal.words.pairs if c.signal.words else ())]
    reverse = any(map(is_reverse, told))
    if reverse or (not told and c.signal.signed):
        draft.doubt("vehicle, direction", "it turns the signs; does it tell which way the sensors' train moves?")
        draft.add(f"direction = {toml(c.name)}")
    else:
        draft.doubt(
            "vehicle, direction",
            f"{c.name} looks like the direction of travel, but no word of it means backwards, and it has no sign",
        )
        draft.add(f"# direction = {toml(c.name)}")


def _torque_is_total(draft: Draft, train: Train) -> None:
    torques = [c for found in train.axles.values() for c in found.get(Quantity.TORQUE, [])[:1]]
    brakes = any(found.get(Quantity.BRAKE_TORQUE) for found in train.axles.values())
    total = bool(torques) and all(contains(c.signal.comment + c.signal.name, TOTAL_WORDS) for c in torques)
    if brakes:
        draft.add("torque_is_total = false # the friction brakes' torque comes by itself")
    elif total:
        draft.add("torque_is_total = true # as the DBC says")
    else:
        draft.doubt(
            "vehicle, torque_is_total",
            "do friction brakes act beside the torque on the bus? With false braking is Degraded; true only if none do",
        )
        draft.add("torque_is_total = false")


def _one(
    draft: Draft,
    dbc: DbcText,
    train: Train,
    q: Quantity,
    about: str,
    found: list[Candidate],
    number: int,
    design: Design,
) -> None:
    if found:
        propose_input(draft, dbc, q.key, about, found, design)
        return
    others = near(train, q)
    bogies = train.by_bogie.get(q, {})
    if q in (Quantity.TORQUE, Quantity.BRAKE_TORQUE) and others:
        per = len(train.axles) // max(1, len(bogies)) or 1
        mine = bogies.get((number - 1) // per + 1, others) if bogies else others
        propose_shared(draft, q.key, about, mine, per if bogies else len(train.axles))
    elif q in NEEDED:
        rest = f"; of no axle in particular: {', '.join(c.name for c in others[:5])}" if others else ""
        draft.todo(about, f"nothing fits: needed{rest}", f"{draft.axle}.{q.key}")
        draft.add(f'# {q.key} = "Message.Signal"')
