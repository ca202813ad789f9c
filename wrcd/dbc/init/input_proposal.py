"""One input: the signal, and what the DBC does not say about it."""

import re
from dataclasses import dataclass, field

from wrcd.bus.dbc import DEFAULT_TIMEOUT_MS, KNOWN_PROFILE, TIMEOUT
from wrcd.bus.mapping import STATUS
from wrcd.bus.units import Quantity
from wrcd.bus.words import STATUS_NAMES, unusable, usable
from wrcd.bus.words import degraded as is_degraded
from wrcd.config.input_mapping import MEASURED
from wrcd.config.section import toml
from wrcd.config.statements import TORQUES, VEHICLE_QUANTITIES
from wrcd.core.design import Design
from wrcd.dbc.dbc_lines import DbcText, Signal
from wrcd.dbc.init.proposal import Proposal
from wrcd.dbc.recognition import (
    LIKELY_GOOD,
    MOTOR_WORDS,
    SURE_SCORE,
    SignalCandidate,
    converts,
    is_adhesion,
    is_counter,
    is_crc,
    is_force,
    is_status,
    is_truth,
    letters,
    numbers,
    words,
)

# Ours: y to the left of travel, yaw counter-clockwise seen from above, traction positive.
OTHER_WAY = {
    Quantity.YAW_RATE: {"clockwise", "uhrzeigersinn", "right", "rechts", "rechtsherum"},
    Quantity.LAT_ACCEL: {"right", "rechts"},
    Quantity.TORQUE: {"braking", "bremsen"},
}
OUR_WAY = {
    Quantity.YAW_RATE: {"counter", "anticlockwise", "counterclockwise", "left", "links", "gegen"},
    Quantity.LAT_ACCEL: {"left", "links"},
    Quantity.TORQUE: {"negative", "negativ", "traction", "total", "traktion"},
}
OTHER_UNITS = {
    Quantity.YAW_RATE: "deg/s", Quantity.LAT_ACCEL: "m/s2", Quantity.TORQUE: "kNm", Quantity.BRAKE_TORQUE: "kNm",
    Quantity.SPEED: "km/h", Quantity.AXLE_LOAD: "kN", Quantity.WHEEL_RADIUS: "mm",
}  # fmt: skip
ENDS_THE_ESTIMATE = (Quantity.TORQUE, Quantity.SPEED)  # past limits.not_available_after_ms, gyro and accelerometer too


@dataclass(slots=True)
class _Keys:
    """The keys of one input; blocked: why it can't stand as it is."""

    keys: dict[str, object]
    blocked: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)


def propose_input(
    draft: Proposal, dbc: DbcText, key: str, about: str, found: list[SignalCandidate], design: Design
) -> None:
    """Write the best candidate; as a comment where a person has to say something first."""
    best, *others = found
    table = _Keys({"signal": best.name})
    if best.signal.comment:
        draft.remark(f"{best.name}: {' '.join(best.signal.comment.split())}")
    if best.score < SURE_SCORE:
        table.doubts.append(f"{best.name} is chosen by its {'unit' if best.signal.unit.strip() else 'name'} alone")
    rivals = [c.name for c in others if c.score >= best.score - 2][:5]
    if rivals:
        table.doubts.append(f"{best.name} is chosen; it could be {', '.join(rivals)}")
    _unit(table, best)
    _sign(table, best)
    _place(table, best)
    _status(table, dbc, best)
    _time(table, dbc, best, design)
    _protection(table, dbc, best)
    if best.quantity in ENDS_THE_ESTIMATE:
        cycle = dbc.number(best.message, "GenMsgCycleTime") or 0
        stated = dbc.number(best.signal, TIMEOUT) or 3 * cycle
        draft.timeouts_ms[best.name] = stated or DEFAULT_TIMEOUT_MS
    if best.signal.low is None and best.quantity is not Quantity.DIRECTION:
        table.doubts.append(f"{best.name} has no range; state it by range = [min, max], in the signal's unit")
    if best.signal.mux not in ("", "M"):
        table.doubts.append(f"{best.name} is multiplexed ({best.signal.mux}): it is there only in some frames")
    for text in table.doubts:
        draft.doubt(about, text)
    for text in table.blocked:
        draft.todo(about, text, f"vehicle.{key}" if best.quantity in VEHICLE_QUANTITIES else f"{draft.axle}.{key}")
    only_signal = len(table.keys) == 1
    line = f"{key} = {toml(best.name if only_signal else table.keys)}"
    draft.add(f"# {line}" if table.blocked else line)


def propose_shared(draft: Proposal, key: str, about: str, found: list[SignalCandidate], axles: int) -> None:
    """A torque of several axles: which share of it acts at this one only a person can say."""
    best = found[0]
    table: dict[str, object] = {"signal": best.name, "share": round(1 / axles, 4)}
    if is_force(best.signal.unit):
        table["at"] = "rim"
    what = f"{best.name} seems to be of {axles} axles together: say which share acts at this one"
    draft.add_todo(about, what, f"{draft.axle}.{key}", f"{key} = {toml(table)}")


def _unit(table: _Keys, c: SignalCandidate) -> None:
    if c.signal.unit.strip() or c.quantity is Quantity.DIRECTION:
        return
    comment_words = set(re.split(r"[\s,;:()\[\]]+", c.signal.comment))
    guess = next((u for u in sorted(comment_words) if converts(u, c.quantity)), OTHER_UNITS[c.quantity])
    table.keys["unit"] = guess
    table.blocked.append(f"{c.name} has no unit in the DBC: is it {guess}?")


def _sign(table: _Keys, c: SignalCandidate) -> None:
    """A brake's effort without a sign; a comment that says which way is positive, the other way than ours."""
    if c.quantity is Quantity.BRAKE_TORQUE and c.signal.low is not None and c.signal.low >= 0:
        table.keys["sign"] = -1
        table.doubts.append(f"{c.name} is never negative: braking counts as positive there, as negative here")
    comment_words = set(words(c.signal.comment))
    if c.quantity in OTHER_WAY and comment_words & OTHER_WAY[c.quantity] and not comment_words & OUR_WAY[c.quantity]:
        table.doubts.append(f"the comment on {c.name} sounds like the other way round than ours: if so, give sign = -1")


def _place(table: _Keys, c: SignalCandidate) -> None:
    """Where a torque acts."""
    if c.quantity not in TORQUES:
        return
    if is_force(c.signal.unit):
        table.keys["at"] = "rim"
        table.doubts.append(f"{c.name} is a force: is it one axle's, at the rim?")
    elif MOTOR_WORDS & {*words(c.signal.name), *words(c.message.name)}:
        table.keys |= {"at": "motor", "gear_ratio": 1.0}
        table.blocked.append(f"{c.name} looks like a motor's torque: give the gear ratio, or take `at` away")


def _status(table: _Keys, dbc: DbcText, c: SignalCandidate) -> None:
    """The status that tells how good the signal is: by words that are known, by words that a person confirms."""
    beside = [s for s in c.message.signals if is_status(s) and s.mux != "M" and _may_be_of(s, c)]
    own = set(words(c.signal.name))
    beside.sort(key=lambda s: (not _branch(s), _number(s) is None))  # the closest first
    nearest = [s for s in beside if own & set(words(s.name))] or beside
    worded = [s for s in nearest if any(unusable(w) or usable(w) for w in s.labels)]
    for s in nearest:
        if not s.words:
            rule = "only 0 lets a value pass" if s.name == STATUS else "it is not looked at"
            table.doubts.append(f"{s.path} has no value table: {rule} unless status and ok are given")
    if not beside:
        _status_elsewhere(table, dbc, c)
    if not worded:
        return
    status, *more = worded
    name = status.path
    if more:
        table.doubts.append(f"{name} is taken as its status; there is {', '.join(s.name for s in more)}, too")
    good = [w for w in status.labels if usable(w)]
    degraded = [w for w in status.labels if is_degraded(w)]
    likely = [w for w in status.labels if letters(w) in LIKELY_GOOD]
    likely_only = not good and bool(likely)
    if likely_only:
        table.doubts.append(f"{name}: does {' or '.join(map(repr, likely))} mean a sound value?")
        good = likely
    if not good:
        table.blocked.append(
            f"{name}: which of {', '.join(map(repr, status.labels))} means a sound value? Put it into ok"
        )
        good = ["?"]
    elif not likely_only and (status.name == STATUS or STATUS_NAMES.search(status.name)) and not more:
        return  # the daemon takes it by itself
    table.keys |= {"status": name, "ok": good} | ({"degraded": degraded} if degraded else {})


def _status_elsewhere(table: _Keys, dbc: DbcText, c: SignalCandidate) -> None:
    """The speed's status in another message, where just one has the speed's name and more: RefSpeedValid of
    RefSpeed."""
    name = words(c.signal.name)
    others = [m for m in dbc.on_the_bus if m is not c.message and not is_adhesion(m) and not is_truth(m)]
    found = [s for m in others for s in m.signals if is_status(s) and words(s.name)[: len(name)] == name]
    if c.quantity is not Quantity.SPEED or len(found) != 1:
        return
    (s,) = found
    good, poor = [w for w in s.labels if usable(w)], [w for w in s.labels if is_degraded(w)]
    if good:
        table.doubts.append(f"{s.path}, in another message, is taken as the status of {c.name}")
        table.keys |= {"status": s.path, "ok": good} | ({"degraded": poor} if poor else {})


def _may_be_of(s: Signal, c: SignalCandidate) -> bool:
    """Whether a status may be about a signal: no other multiplexer's branch, no other axle's number."""
    return _branch(s) in ("", _branch(c.signal)) and (
        _number(s) is None or _number(c.signal) is None or _number(s) == _number(c.signal)
    )


def _branch(s: Signal) -> str:
    """The multiplexer's value in whose frames a signal is ("": every frame)."""
    return s.mux.removesuffix("M")


def _frames_for_one(c: SignalCandidate) -> int:
    """Of how many frames of its message one carries a signal, by simple multiplexing."""
    signals = c.message.signals
    if not _branch(c.signal) or any(_branch(s) != s.mux and _branch(s) for s in signals):
        return 1
    return len({_branch(s) for s in signals if _branch(s)})


def _number(s: Signal) -> int | None:
    """The axle that a signal's own name tells."""
    return numbers("", s.name)[0]


def _time(table: _Keys, dbc: DbcText, c: SignalCandidate, design: Design) -> None:
    cycle = dbc.number(c.message, "GenMsgCycleTime")
    tick_ms = 1000 * design.tick_s
    if c.quantity in MEASURED:
        if cycle and cycle > tick_ms:
            table.blocked.append(
                f"{c.name} comes every {cycle:g} ms, the design's tick is {tick_ms:g} ms: have it sent faster, or make "
                "a design for a longer tick"
            )
        elif cycle and cycle * (frames := _frames_for_one(c)) > tick_ms:
            table.blocked.append(
                f"{c.name} comes in one of {frames} frames, every {cycle * frames:g} ms, the design's tick is "
                f"{tick_ms:g} ms: have it sent faster, or make a design for a longer tick"
            )
        elif not cycle:
            table.doubts.append(f"{c.message.name} has no cycle in the DBC; every {tick_ms:g} ms is needed")
    elif not cycle and not dbc.number(c.signal, TIMEOUT):
        table.doubts.append(
            f"{c.message.name} has neither cycle nor time-out: {DEFAULT_TIMEOUT_MS} ms are taken; timeout_ms states it"
        )


def _protection(table: _Keys, dbc: DbcText, c: SignalCandidate) -> None:
    profile = dbc.e2e_profile(c.message)
    if profile and profile != KNOWN_PROFILE:
        table.blocked.append(
            f'{c.message.name} has E2E profile {profile!r}; only P11 is known, e2e = "none" reads unchecked'
        )
    signals = c.message.signals
    if not profile and any(map(is_crc, signals)) and any(map(is_counter, signals)):
        table.doubts.append(
            f'{c.message.name} has a CRC and a counter, but no E2EProfile: if it is P11, give e2e = "P11" and data_id'
        )
