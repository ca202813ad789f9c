"""How the daemon and its link are, from what it says and from what it does not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.bus.reasons import Reason
from wrcd.tools.counts import growth
from wrcd.tools.monitor.axle import words
from wrcd.tools.monitor.model import Heard, Model
from wrcd.tools.monitor.spells import SILENT_CYCLES

STATUS, REJECTS, LINK = "status_message", "rejects_message", "link_message"
# counts that wrap round, by message: name, modulo, what a person calls it
COUNTS = {
    STATUS: (("Overruns", 256, "overruns"), ("ReceiveDrops", 64, "drops"), ("Reopens", 16, "reopens")),
    LINK: (("Unsent", 256, "unsent"), ("ErrorFrames", 4096, "error frames"), ("BusOffs", 16, "bus-offs"),
           ("TimeSteps", 16, "time steps"), ("Restarts", 256, "restarts")),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class DaemonNow:
    """level: "good", "warn" or "bad"."""

    level: str
    state: str  # "Running", "silent", …
    parts: Sequence[str]  # what else there is to say, the most important first


def daemon_at(model: Model, at_us: int) -> DaemonNow:
    """At a time."""
    if model.is_estimated:
        heard_of = any(len(h.table) for h in model.outputs.values()) or any(
            w.refusals for w in model.watched.values() if w.name in _adhesion(model)
        )
        what = "no Adhesion frame that is right" if heard_of else "no daemon"
        return DaemonNow("warn", "not heard", [f"{what} in the log: estimated here"])
    silent = silence(model, at_us)
    if silent is not None:
        return DaemonNow("bad", "silent", [silent])
    parts: list[str] = []
    level, state = "good", "heard"
    heard = _fresh(model.outputs.get(STATUS), at_us)
    if heard is not None:
        place = int(heard["State"]) if "State" in heard else -1
        names = words(STATUS, "State")
        state = names[place] if 0 <= place < len(names) else "unknown state"
        if state != "Running":
            level = "bad" if state == "LinkDown" else "warn"
        checksum = heard.get("DesignChecksum", float("nan"))
        own = int(model.config.design.checksum[:4], 16)
        if np.isfinite(checksum) and int(checksum) != own:
            parts.append(f"runs another design ({int(checksum):04x}, here {own:04x}): rules and models may differ")
            level = "warn"
    elif STATUS in model.outputs and len(model.outputs[STATUS].table):
        parts.append(f"no {model.outputs[STATUS].said.name}")
        level = "warn"
    link = _fresh(model.outputs.get(LINK), at_us)
    if link is not None and "LinkState" in link:
        place, names = int(link["LinkState"]), words(LINK, "LinkState")
        name = names[place] if 0 <= place < len(names) else "unknown"
        parts.append(f"its link {name}")
        if name != "Up":
            level = "bad"
    rejected = _fresh(model.outputs.get(REJECTS), at_us)
    if rejected is not None:
        found = [f"{int(n)} {r.value}" for r in Reason if (n := rejected.get(f"Rejected{r.label}", 0.0)) > 0]
        if found:
            parts.append(f"refused in a second: {', '.join(found)}")
        if rejected.get("ForeignFrames", 0.0) > 0:
            parts.append(f"{int(rejected['ForeignFrames'])} frames of another sender under its ids")
            level = "warn"
    for message, counts in COUNTS.items():
        if message in model.outputs:
            for name, modulo, told in counts:
                n = _grown(model.outputs[message], name, modulo, at_us)
                if n:
                    parts.append(f"{told} +{n}")
    return DaemonNow(level, state, parts)


def silence(model: Model, at_us: int) -> str | None:
    """What to say of a daemon that sends no Adhesion frame; None of one that does."""
    newest, limit_us = None, 0
    for axle in model.axles:
        times = axle.adhesion.time_us
        k = int(np.searchsorted(times, at_us, side="right"))
        limit_us = max(limit_us, SILENT_CYCLES * axle.cycle_us)
        if k:
            newest = max(newest or 0, int(times[k - 1]))
    if newest is None:
        since = "" if model.begin_us is None else f" in {max(at_us - model.begin_us, 0) / 1e6:.1f} s"
        refused = sum(w.refusals for w in model.watched.values() if w.name in _adhesion(model))
        return f"no Adhesion frame{since}" + (f", {refused} damaged" if refused else "")
    return f"no Adhesion frame for {(at_us - newest) / 1e6:.1f} s" if at_us - newest > limit_us else None


def _adhesion(model: Model) -> set[str]:
    return {a.adhesion.message for a in model.config.axles}


def _fresh(heard: Heard | None, at_us: int) -> "dict[str, float] | None":
    """What the newest frame said, where it is not too old."""
    found = None if heard is None else heard.at(at_us)
    if heard is None or found is None or at_us - found[0] > SILENT_CYCLES * heard.said.cycle_us:
        return None
    return dict(found[1])


def _grown(heard: Heard, name: str, modulo: int, at_us: int) -> int:
    """By how much a count that wraps round has grown since the first frame that is held."""
    if name not in heard.said.names:
        return 0
    k = int(np.searchsorted(heard.table["time_us"], at_us, side="right"))
    column = np.asarray(heard.table[name][:k], dtype=np.float64)
    column = column[np.isfinite(column)]
    return int(growth(column, modulo).sum())
