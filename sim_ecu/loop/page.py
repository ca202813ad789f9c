"""The loop's runs as one page without anything outside it, in the style of the score's."""

from collections.abc import Sequence
from typing import Any

from sim_ecu.loop.picture import pictures
from sim_ecu.loop.play import Outcome
from sim_ecu.loop.tables import QUICK, tables
from sim_ecu.score.page import document, loud_lines, verdict


def page(result: dict[str, Any], outcomes: Sequence[Outcome]) -> str:
    """HTML, in English, with pictures inside."""
    loud = loud_lines(result, QUICK)
    lines = [line for line in tables(result) if line not in loud]
    head = [
        *verdict(result["goals"]),
        f"<p>{_runs(result['wrong'])} of {_played(result)} runs had a daemon that was wrong for longer than its "
        "interval allows: they are named below.</p>",
    ]
    return document(
        "sim-ecu loop", "What is wrcd worth to a controller?", loud, head,
        pictures(result, outcomes), lines,
    )  # fmt: skip


def _runs(wrong: Sequence[dict[str, Any]]) -> int:
    return len({(w["suite"], w["case"], w["controller"], w["seed"]) for w in wrong})


def _played(result: dict[str, Any]) -> int:
    return sum(bool(r["said"]) for r in result["runs"])
