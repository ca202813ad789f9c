"""The file of a vehicle that was found from logs."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from datetime import date

from sim_ecu.design.calibrate.calibration import Calibration
from sim_ecu.physics.wheelset import Wheelset

DIGITS = 5


def vehicle_text(c: Calibration, name: str, logs: Sequence[tuple[str, str]], day: date) -> str:
    """Return the file's text. logs: names and digests."""
    w = c.wheelset
    assert w.bogie is not None
    usual = Wheelset().numbers()
    own = {n: v for n, v in w.numbers().items() if n not in ("M_v", "k_w") and (n in c.intervals or v != usual[n])}
    return "\n".join([
        f"# Found by `sim-ecu calibrate` from {c.stretches} calm stretches of the train's own logs.",
        f'title = {_text(f"{name}, found from its own logs")}',
        "", "[wheelset]", f"name = {_text(name)}", *_numbers(own),
        "", "[vehicle]", *_numbers(asdict(w.bogie)),
        "", "# each constant lies within it with 90 %", "[interval]",
        *(f"{n} = [{_number(low)}, {_number(high)}]" for n, (low, high) in c.intervals.items()),
        "", "[origin]", f'date = "{day.isoformat()}"',
        f"logs = [{', '.join(_text(f'{log} sha256 {digest}') for log, digest in logs)}]", f"stretches = {c.stretches}",
    ]) + "\n"  # fmt: skip


def _numbers(values: dict[str, float]) -> Iterable[str]:
    return (f"{name} = {_number(value)}" for name, value in values.items())


def _number(value: float) -> str:
    return repr(float(f"{value:.{DIGITS}g}"))


def _text(words: str) -> str:
    return json.dumps(words, ensure_ascii=False)
