"""`wrcd init`: a configuration proposed for a DBC, key by key: what fits best, what else might, and what is open."""

import os
import sys
from pathlib import Path

from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.bus.units import Quantity
from wrcd.bus.words import is_reverse
from wrcd.config import declared
from wrcd.config.config import mistakes
from wrcd.config.describe import KNOWN_BY
from wrcd.config.section import toml
from wrcd.core.design import Design, load_design
from wrcd.dbc.dbc_lines import DbcText, read
from wrcd.dbc.init.adhesion_proposal import propose_adhesion
from wrcd.dbc.init.axle_numbers import PER_AXLE, Arrangement, arrange, near
from wrcd.dbc.init.input_proposal import propose_input, propose_shared
from wrcd.dbc.init.proposal import Proposal
from wrcd.dbc.recognition import TOTAL_WORDS, SignalCandidate, candidates, contains
from wrcd.errors import InputError, create

NEEDED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE)


def init(dbc: Path, output: Path | None, force: bool) -> int:
    """Write the proposal to a file or to stdout, and to stderr what is open and unsure. Raises InputError."""
    if output is not None and output.exists() and not force:
        raise InputError("is there already", file=output, hint="name another file, or overwrite it by --force")
    text = read(dbc)
    load_dbc(dbc)
    draft = propose(text, Path() if output is None else output.parent)
    if output is None:
        print(draft.text(), end="")
    else:
        with create(output) as file:
            file.write(draft.text())
    for line in draft.summary(output):
        print(line, file=sys.stderr)
    return 0


def propose(dbc: DbcText, folder: Path, design: Design | None = None) -> Proposal:
    """Return the draft of a configuration that lies in a folder.

    design: without it the default one. Raises InputError where it can't be read.
    """
    design = design or load_design(resources.DESIGN)
    draft = Proposal(dbc.file.name)
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
            about, candidates_of_it = f"axle {number}, {q.key}", found.get(q, [])
            if candidates_of_it:
                propose_input(draft, dbc, q.key, about, candidates_of_it, design)
            else:
                _without_candidate(draft, train, q, about, number)
        propose_adhesion(draft, dbc, number, len(numbers))
    _limits(draft)
    draft.refused(mistakes("\n".join(draft.lines), dbc.file, folder, design))
    return draft


def _limits(draft: Proposal) -> None:
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
        what = f"{name} has a time-out of {longest:g} ms, more than {limit.high:g}: give it a timeout_ms"
        draft.add_todo(about, what, f"limits.{limit.name}", line)


def _head(draft: Proposal, dbc: DbcText, folder: Path, design: Design) -> None:
    draft.add(
        'bus = { interface = "socketcan", channel = "can0" } # where the frames are',
        f"dbc = {{ file = {toml(Path(os.path.relpath(dbc.file, folder)).as_posix())} }}",
        "",
    )
    name = str(design.wheelset.get("name", design.name))
    draft.todo(
        "wheelset",
        f"is it the wheelset {name!r} of the default design? The signals of many another one look alike, "
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


def _vehicle(draft: Proposal, dbc: DbcText, train: Arrangement, design: Design) -> None:
    for text in train.doubts:
        draft.doubt("axles", text)
    if train.left_out:
        draft.todo("axles", f"one daemon takes eight; left out: {', '.join(map(str, train.left_out))}", "axle")
    speeds = train.vehicle[Quantity.SPEED]
    if speeds:
        propose_input(draft, dbc, "speed", "vehicle, speed", speeds, design)
    else:
        what = "nothing looks like the train's speed: name the signal, or give limits.constant_speed_m_s"
        draft.add_todo("vehicle, speed", what, "vehicle.speed", 'speed = "Message.Signal"')
    for c in train.vehicle[Quantity.DIRECTION][:1]:
        _direction(draft, c)
    _torque_is_total(draft, train)


def _direction(draft: Proposal, c: SignalCandidate) -> None:
    if any(map(is_reverse, c.signal.labels)) or (not c.signal.labels and c.signal.signed):
        draft.doubt("vehicle, direction", "it turns the signs; does it tell which way the sensors' train moves?")
        draft.add(f"direction = {toml(c.name)}")
    else:
        draft.doubt(
            "vehicle, direction",
            f"{c.name} looks like the direction of travel, but no word of it means backwards, and it has no sign",
        )
        draft.add(f"# direction = {toml(c.name)}")


def _torque_is_total(draft: Proposal, train: Arrangement) -> None:
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


def _without_candidate(draft: Proposal, train: Arrangement, q: Quantity, about: str, number: int) -> None:
    others = near(train, q)
    bogies = train.by_bogie.get(q, {})
    if q in (Quantity.TORQUE, Quantity.BRAKE_TORQUE) and others:
        per = len(train.axles) // max(1, len(bogies)) or 1
        mine = bogies.get((number - 1) // per + 1, others) if bogies else others
        propose_shared(draft, q.key, about, mine, per if bogies else len(train.axles))
    elif q in NEEDED:
        rest = f"; of no axle in particular: {', '.join(c.name for c in others[:5])}" if others else ""
        draft.add_todo(about, f"nothing fits: needed{rest}", f"{draft.axle}.{q.key}", f'{q.key} = "Message.Signal"')
