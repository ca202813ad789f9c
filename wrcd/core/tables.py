"""The core's tables, from configuration, DBC and design: which bits of which message are which input, which words mean
what, what is sent. Made once. Members of a record are those of wrcd/core/c/wrcd.h."""

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from wrcd.bus.dbc import find_message
from wrcd.bus.e2e import crc_of_data_id
from wrcd.bus.frame import EXTENDED, mask_of
from wrcd.bus.mapping import Mapped, MappedMessage, MappedSignal
from wrcd.bus.positions import MAX_BITS, Branch, Field
from wrcd.bus.units import Quantity
from wrcd.bus.writers import SignalWriter, Writer
from wrcd.core.configuration import AXLE_OUTPUTS, LOAD_SHARES, RADIUS_SHARES, Config, Input
from wrcd.core.design_fit import fit_members
from wrcd.core.layouts import layouts, told_names
from wrcd.core.terms import MAX_SIGNALS
from wrcd.core.vocabulary import CONFIDENCES, SURFACES, words_of

QUANTITIES = tuple(Quantity)
YAW, LAT, TORQUE, SPEED, BRAKE, LOAD, DIRECTION, RADIUS = range(len(QUANTITIES))
# What no vehicle changes by from one frame to the next (or within 0.1 s, if that is longer).
MAX_STEP = {TORQUE: 4000.0, BRAKE: 4000.0, SPEED: 1.0, LOAD: 20_000.0, RADIUS: 0.02}
_OWN = ("status_message", "rejects_message", "link_message")
_KINDS = {
    "adhesion": 0, "detail": 1, "inputs": 2, "own": 3, "status_message": 4, "rejects_message": 5, "link_message": 4,
}  # fmt: skip
_UNSIGNED, _SIGNED, _FLOAT = range(3)
Records = np.ndarray[Any, Any]
Tables = dict[str, Records]


class _Rows:
    """A table as it grows: rows with ranges of other tables."""

    def __init__(self) -> None:
        self.numbers: list[int] = []  # as int64
        self.words: list[int] = []
        self.rules: list[int] = []
        self.conditions: list[dict[str, Any]] = []

    def numbered(self, name: str, of: Iterable[int]) -> dict[str, int]:
        """A range of numbers."""
        values = list(map(_int64, of))
        self.numbers += values
        return {f"first_{name}": len(self.numbers) - len(values), name: len(values)}

    def ruled(self, name: str, of: Sequence[int]) -> dict[str, int]:
        """A range of statuses."""
        self.rules += of
        return {f"first_{name}": len(self.rules) - len(of), name: len(of)}

    def reversing(self, s: MappedSignal) -> dict[str, int]:
        """The words of a direction."""
        self.words += [x for raw, reverse in s.words.items() for x in (_int64(raw), int(reverse))]
        return {"first_words": len(self.words) // 2 - len(s.words), "words": len(s.words)}

    def conditioned(self, branch: Branch) -> dict[str, int]:
        """When a frame carries what is behind multiplexers."""
        rows = [
            {**_place(at.order, at.shift, at.mask, at.sign), **self.numbered("numbers", sorted(ids))}
            for _, at, ids in branch.conditions
        ]
        self.conditions += rows
        return {"first_conditions": len(self.conditions) - len(rows), "conditions": len(rows)}


def _int64(x: int) -> int:
    """The bits of 64 as C compares them."""
    return x - (1 << 64) if x >= 1 << 63 else x


def _place(order: str, shift: int, mask: int, sign: int, is_float: bool = False) -> dict[str, int]:
    assert mask.bit_length() <= MAX_BITS
    kind = _FLOAT if is_float else _SIGNED if sign else _UNSIGNED
    return {"shift": shift, "bits": mask.bit_length(), "is_big_endian": order == "big", "kind": kind}


def _field(field: Field) -> dict[str, int]:
    at = field.position
    return _place(at.order, at.shift, at.mask, at.sign, field.is_float)


def _filled(kind: str, rows: Sequence[dict[str, Any]]) -> Records:
    """Records of rows; one at least, so that it has an address."""
    out = np.zeros(max(1, len(rows)), dtype=layouts()[kind])
    for record, row in zip(out, rows, strict=False):
        for name, value in row.items():
            if isinstance(value, (list, tuple, bytes)):
                record[name][: len(value)] = list(value)
            else:
                record[name] = value
    return out


def input_tables(mapped: Mapped, inputs: Sequence[Input], silent: Sequence[int] = ()) -> Tables:
    """Of what is read: messages, inputs, statuses. silent: of each input, us without which there is no estimate."""
    rows, place = _Rows(), {rule: k for k, rule in enumerate(mapped.statuses)}
    status = [
        {
            **_field(s.field), **rows.conditioned(s.branch), **rows.numbered("oks", sorted(s.ok)),
            **rows.numbered("degradeds", sorted(s.degraded)), "is_kept": s.is_kept, "timeout_us": s.timeout_us,
        }
        for s in mapped.statuses.values()
    ]  # fmt: skip
    signals = mapped.signals
    of_parts = _parts(signals)
    known = [_input(rows, s, inputs[s.number], [place[r] for r in s.source.statuses]) for s in signals]
    for k, row in enumerate(known):
        row["next"] = of_parts.get(k, -1)
        row["silent_us"] = silent[signals[k].number] if silent else 0
    message, first = [], 0
    for m in mapped.messages:
        assert len(m.signals) <= MAX_SIGNALS, m.name
        tells = [k for k, s in enumerate(mapped.statuses.values()) if s.is_kept and s.rule.message == m.name]
        row = {**_message(rows, m), **rows.ruled("tells", tells)}
        message.append(row | {"first_signals": first, "signals": len(m.signals)})
        first += len(m.signals)
    return {
        "message": _filled("message", message), "input": _filled("input", known), "status": _filled("status", status),
        "condition": _filled("condition", rows.conditions), "number": np.array([*rows.numbers, 0], np.int64),
        "word": np.array([*rows.words, 0], np.int64), "rule": np.array([*rows.rules, 0], np.int32),
    }  # fmt: skip


def _message(rows: _Rows, m: MappedMessage) -> dict[str, Any]:
    return {
        "word": m.key, "mask": mask_of(m.wanted), "length": m.length, "is_fd": m.fd, "is_multiplexed": m.is_multiplexed,
        "is_protected": m.data_id is not None, "crc_start": 0 if m.data_id is None else crc_of_data_id(m.data_id),
        **rows.numbered("others", map(crc_of_data_id, m.others)),
    }  # fmt: skip


def _input(rows: _Rows, s: MappedSignal, i: Input, rules: Sequence[int]) -> dict[str, Any]:
    quantity = QUANTITIES.index(s.source.quantity)
    said = {name: getattr(s, name, getattr(s.source, name, None)) for name in layouts()["input"].names or ()}
    return {name: value for name, value in said.items() if value is not None} | {
        **_field(s.field), **rows.conditioned(s.branch), **rows.numbered("unusable", sorted(s.unusable)),
        **rows.reversing(s), **rows.ruled("rules", rules), "limit": s.source.quantity.limit, "first_end": s.ends[0],
        "last_end": s.ends[1], "max_step": MAX_STEP.get(quantity, 0.0), "timeout_us": i.timeout_us,
        "quantity": quantity, "axles": sum(1 << axle for axle in s.source.axles),
    }  # fmt: skip


def _parts(signals: Sequence[MappedSignal]) -> dict[int, int]:
    """Which input comes behind which where several add up to a quantity of an axle."""
    chains: dict[tuple[Quantity, int], list[int]] = {}
    for k in sorted(range(len(signals)), key=lambda k: signals[k].source.part):
        for axle in signals[k].source.axles:
            chains.setdefault((signals[k].source.quantity, axle), []).append(k)
    return {one: other for chain in chains.values() for one, other in itertools.pairwise(chain)}


def silent_us(config: Config, i: Input) -> int:
    """After which an input is silent: a slow one (load, radius, direction) may take its own time-out, a measurement may
    not."""
    after = config.not_available_after_us
    return after if QUANTITIES.index(i.source.quantity) <= SPEED else max(i.timeout_us, after)


def tables_of(config: Config, mapped: Mapped) -> Tables:
    """All that the core of a configuration needs beside its design."""
    out = input_tables(mapped, config.inputs, [silent_us(config, i) for i in config.inputs])
    sent, told = _sent(config)
    out |= {"sent": _filled("sent", sent), "told": _filled("told", told)}
    out["fit"] = _filled("fit", [fit_members(config.design)])
    out["settings"] = _filled("settings", [_settings(config, mapped, out, len(sent))])
    starts = out["settings"]["start"][0]
    for row, s in zip(out["input"], mapped.signals, strict=False):
        row["start"] = 0.0 if s.source.part else starts[row["quantity"]]
    return out


def _settings(config: Config, mapped: Mapped, tables: Tables, sent: int) -> dict[str, Any]:
    design, n, signals = config.design, len(config.axles), mapped.signals
    first = {
        (QUANTITIES.index(s.source.quantity), axle): k
        for k, s in enumerate(signals) if not s.source.part for axle in s.source.axles
    }  # fmt: skip
    has_brakes = {axle for q, axle in first if q == BRAKE}
    in_parts = any(s.source.part and s.source.quantity is Quantity.TORQUE for s in signals)
    starts = {LOAD: 2 * design.normal_N, DIRECTION: 1.0, RADIUS: design.r_0, SPEED: np.nan}
    if config.constant_speed_m_s is not None:
        starts[SPEED] = config.constant_speed_m_s
    bogies = config.bogies
    partners = dict((*bogies, *((b, a) for a, b in bogies)))
    of_axles = np.full((len(QUANTITIES), layouts()["settings"]["input_of"].shape[0] // len(QUANTITIES)), -1)
    for (q, axle), k in first.items():
        of_axles[q, axle] = k
    return {
        "period_us": round(design.tick_s * 1e6), "design_checksum": int(design.checksum[:4], 16),
        "input_cycle_us": [0 if a.inputs is None else a.inputs.cycle_us for a in config.axles],
        "min_speed_m_s": config.min_speed_m_s, "speed_low_m_s": design.speeds_m_s[0],
        "speed_high_m_s": design.speeds_m_s[-1], "start": [starts.get(q, 0.0) for q in range(len(QUANTITIES))],
        "load_N": 2 * design.normal_N, "radius_m": design.r_0,
        "load_shares": LOAD_SHARES, "radius_shares": RADIUS_SHARES,
        "surface_pct": [low for low, _ in SURFACES], "confidence_pp": [most for most, _ in CONFIDENCES],
        "surfaces": len(SURFACES), "confidences": len(CONFIDENCES), "axles": n,
        "bogies": len(bogies) if tables["fit"]["ticks"][0] else 0, "messages": len(mapped.messages),
        "inputs": len(signals), "statuses": len(mapped.statuses), "sent": sent, "window_ticks": design.window_ticks,
        "recent_ticks": design.recent_ticks, "torque_is_total": config.torque_is_total,
        "torque_sign_counts": not (config.torque_is_total or len(has_brakes) == n) or bool(has_brakes) or in_parts,
        "speed_tells_direction": not any(q == DIRECTION for q, _ in first), "input_of": of_axles.reshape(-1).tolist(),
        "position_m": [np.nan if a.position_m is None else a.position_m for a in config.axles],
        "number": [a.number for a in config.axles], "is_placed": config.fuses,
        "partner": [partners.get(k, -1) for k in range(n)], "axles_of": [k for pair in bogies for k in pair],
    }  # fmt: skip


def _sent(config: Config) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The messages that are sent, in a slot's order, and their fields."""
    of_axles = [(kind, axle, getattr(a, kind)) for kind in AXLE_OUTPUTS for axle, a in enumerate(config.axles)]
    outputs = (config.status, config.rejects, config.link)
    own = [(kind, -1, output) for kind, output in zip(_OWN, outputs, strict=True)]
    sent: list[dict[str, Any]] = []
    told: list[dict[str, Any]] = []
    for kind, axle, output in (*of_axles, *own):
        if output is None:
            continue
        writer = Writer(find_message(config.database, output.message), output)
        fields = [_told(kind, name, signal) for name, signal in writer.writers.items()]
        sent.append({
            "cycle_us": output.cycle_us, "word": writer.can_id | EXTENDED * writer.extended, "axle": axle,
            "kind": _KINDS[kind], "length": writer.length, "is_protected": output.data_id is not None,
            "crc_start": 0 if output.data_id is None else crc_of_data_id(output.data_id), "first_told": len(told),
            "told": len(fields), "is_last": kind == "status_message", "start": writer.start,
        })  # fmt: skip
        told += fields
    return sent, told


def _told(kind: str, name: str, s: SignalWriter) -> dict[str, Any]:
    factor, low, high, scale, offset = s.numbers
    lowest, highest, not_available = s.raws
    words = words_of(kind, name)
    return {
        **_place(s.order, s.shift, s.mask, 0), "what": told_names().index(name), "is_word": bool(words),
        "word_raw": [s.raw(word) & s.mask for word in words], "unit_factor": factor, "low": low, "high": high,
        "scale": scale, "offset": offset, "lowest": lowest, "highest": highest,
        "lowest_raw": lowest & s.mask, "highest_raw": highest & s.mask, "rounds": s.rounds,
        "not_available": not_available & s.mask, "is_rounded_down": s.rounds_down,
    }  # fmt: skip
