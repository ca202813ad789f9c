"""Lint: cycles and time-outs."""

from collections.abc import Collection, Iterator

from wrcd.bus.dbc import LONGEST_MS
from wrcd.mapping.inputs import MEASURED
from wrcd.tools.dbc.candidates import Candidate
from wrcd.tools.dbc.records import DbcText, Message, Signal
from wrcd.tools.dbc.vocabulary import is_adhesion
from wrcd.tools.lint.codes import Finding

SEND_TYPE = "GenMsgSendType"


def check(dbc: DbcText, inputs: Collection[Candidate], tick_s: float) -> Iterator[Finding]:
    """Every finding. inputs: what looks like one."""
    relevant = {c.message.line for c in inputs}
    for m in dbc.on_the_bus:
        cycle = dbc.number(m, "GenMsgCycleTime")
        line = dbc.attribute_line(m, "GenMsgCycleTime")
        if _no_time(cycle):
            yield Finding(line, "cycle-no-time", m.name, f"a cycle of {cycle:g} ms")
        elif not cycle:
            matters = m.line in relevant or is_adhesion(m)
            kind = dbc.attribute(m, SEND_TYPE) or ""
            if "cycl" in kind.lower() and (matters or SEND_TYPE in m.attributes):
                at = dbc.attribute_line(m, SEND_TYPE)
                yield Finding(at, "cyclic-without-cycle", m.name, f"{SEND_TYPE} {kind}, cycle 0")
            elif matters:
                yield Finding(m.line, "no-cycle", m.name, "no GenMsgCycleTime")
        for s in m.signals:
            yield from _timeout(dbc, m, s, cycle or 0.0)
    slow: set[int] = set()
    for c in inputs:
        cycle = dbc.number(c.message, "GenMsgCycleTime") or 0.0
        # of gyro and accelerometer the time-out is three ticks, whatever the DBC says
        if cycle and c.quantity not in MEASURED and not dbc.number(c.signal, "GenSigTimeoutTime"):
            what = f"no GenSigTimeoutTime: {3 * cycle:g} ms are taken"
            yield Finding(c.signal.line, "no-timeout", c.name, what)
        if c.quantity in MEASURED and cycle > 1000 * tick_s and c.message.line not in slow:
            slow.add(c.message.line)
            line = dbc.attribute_line(c.message, "GenMsgCycleTime")
            what = f"every {cycle:g} ms; the design's tick is {1000 * tick_s:g} ms"
            yield Finding(line, "cycle-above-tick", c.message.name, what)


def _no_time(ms: float | None) -> bool:
    return ms is not None and ms != 0 and not 1 <= ms <= LONGEST_MS


def _timeout(dbc: DbcText, m: Message, s: Signal, cycle: float) -> Iterator[Finding]:
    timeout = dbc.number(s, "GenSigTimeoutTime")
    line = dbc.attribute_line(s, "GenSigTimeoutTime")
    if _no_time(timeout):
        yield Finding(line, "cycle-no-time", f"{m.name}.{s.name}", f"a time-out of {timeout:g} ms")
    elif timeout and timeout < cycle:
        yield Finding(line, "timeout-below-cycle", f"{m.name}.{s.name}", f"{timeout:g} ms, cycle {cycle:g} ms")
