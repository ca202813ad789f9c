"""Whether adhesion frames did what a row of the fault matrix says, and the table of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sim_ecu.play.expected import SETTLED_AFTER_MS, SETTLED_PP, Found, Leaves, Must, Row, Stays
from sim_ecu.play.faults import ALL, KINDS, Stage


@dataclass(frozen=True, slots=True)
class Said:
    """One adhesion frame. slot numbers it, mu_pct is None where it says not available."""

    stamp_us: int
    slot: int
    valid: bool
    mu_pct: float | None


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was measured, None where it never happened, and what is wrong with it (empty: nothing)."""

    left_ms: float | None  # Valid, after the fault's begin
    back_ms: float | None  # to Valid, after its end
    change_pp: float | None  # of MuAvailable, at most, while Valid
    settled_pp: float | None  # the same, the longest window after the fault
    wrong: str

    def worst(self, other: "Verdict") -> "Verdict":
        """Of two plays of a row, the larger figures and what is wrong with either."""

        def larger(a: float | None, b: float | None) -> float | None:
            return max((x for x in (a, b) if x is not None), default=None)

        return Verdict(
            larger(self.left_ms, other.left_ms), larger(self.back_ms, other.back_ms),
            larger(self.change_pp, other.change_pp), larger(self.settled_pp, other.settled_pp),
            self.wrong or other.wrong,
        )  # fmt: skip


def judge(
    must: Must, begin_us: int, end_us: int, said: Sequence[Said], without: Mapping[int, float],
    slack_ms: float = 0.0, slack_pp: float = 0.0,
) -> Verdict:  # fmt: skip
    """Judge the frames of an axle from a fault's begin on, beside MuAvailable without the fault, by slot. The slacks
    are for a bus whose clock is not virtual."""
    said = [s for s in said if s.stamp_us > begin_us]
    left = next((s.stamp_us for s in said if not s.valid), None)
    back = next((s.stamp_us for s in said if s.valid and left is not None and s.stamp_us > max(end_us, left)), None)
    changes = [
        (s.stamp_us, abs(s.mu_pct - without[s.slot]))
        for s in said
        if s.valid and s.mu_pct is not None and s.slot in without
    ]
    settled_us = end_us + round(SETTLED_AFTER_MS * 1000)
    verdict = Verdict(
        left_ms=None if left is None else (left - begin_us) / 1000,
        back_ms=None if back is None else (back - end_us) / 1000,
        change_pp=max((pp for _, pp in changes), default=None),
        settled_pp=max((pp for t, pp in changes if t > settled_us), default=None),
        wrong="",
    )
    wrong = ""
    if isinstance(must, Leaves):
        wrong = _left(must, verdict, slack_ms)
        if any(s.valid for s in said if left is not None and left < s.stamp_us <= end_us):
            wrong = wrong or "Valid during the fault"
        if any(not s.valid for s in said if back is not None and s.stamp_us > back):
            wrong = wrong or "not Valid for good afterwards"
    elif isinstance(must, Stays):
        wrong = _stayed(must, verdict, slack_pp)
    elif isinstance(must, Found):
        until_us = begin_us + round((must.within_ms + slack_ms) * 1000)
        late = any(s.valid for s in said if until_us < s.stamp_us <= end_us)
        return replace(verdict, back_ms=None, settled_pp=None, wrong="not found out" if late else "")
    if verdict.settled_pp is None or verdict.settled_pp > SETTLED_PP + slack_pp:
        wrong = wrong or "not itself again"
    return replace(verdict, wrong=wrong)


def _left(must: Leaves, v: Verdict, slack_ms: float) -> str:
    if v.left_ms is None or v.left_ms > must.within_ms + slack_ms:
        return "Valid for too long"
    return "not Valid again in time" if v.back_ms is None or v.back_ms > must.back_ms + slack_ms else ""


def _stayed(must: Stays, v: Verdict, slack_pp: float) -> str:
    if v.left_ms is not None:
        return "not Valid throughout"
    return "changed too much" if v.change_pp is None or v.change_pp > must.within_pp + slack_pp else ""


HEAD = (
    "| fault | of | s | must | left Valid after, ms | Valid again after, ms | largest change while Valid, pp "
    "| the longest window later, pp | passed |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def which(row: Row) -> tuple[str, str, str]:
    """A row's fault for a person: the kind, of what, for how many seconds."""
    f = row.fault
    of = "bus" if KINDS[f.kind].stage is Stage.BUS else {ALL: "all of the axle"}.get(f.of, f.of.replace("_", " "))
    return f.kind if f.amount is None else f"{f.kind} {f.amount:g}", of, f"{f.duration_s:g}"


def line(row: Row, v: Verdict) -> str:
    """A row of the table, as Markdown."""

    def shown(x: float | None, digits: int) -> str:
        return "–" if x is None else f"{x:.{digits}f}"

    return (
        f"| {' | '.join(which(row))} | {row.must} | {shown(v.left_ms, 0)} | {shown(v.back_ms, 0)} "
        f"| {shown(v.change_pp, 2)} | {shown(v.settled_pp, 2)} | {f'NO: {v.wrong}' if v.wrong else 'yes'} |"
    )
