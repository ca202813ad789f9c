"""`sim-ecu compare`: reads two campaigns' folders, compares them, prints the tables."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from sim_ecu.campaign.comparison.compare import WORSE, Result, compare, document
from sim_ecu.campaign.comparison.read import read
from sim_ecu.campaign.comparison.tables import tables
from sim_ecu.campaign.comparison.worst import Worst, worst
from sim_ecu.commands.outputs import check_output, write_results
from wrcd.errors import InputError, Status
from wrcd.tools.progress import Progress


def run(
    first: Path, second: Path, names: Sequence[str] | None, alpha: float, fail_on: str | None, json_out: Path | None,
    html_out: Path | None,
) -> int:  # fmt: skip
    """Compare and print; write all of it as JSON and a page where asked for.

    Raises InputError for bad input, and after all that where it was asked to fail on what could not be judged.
    """
    check_output("--json", json_out)
    check_output("--html", html_out)
    progress = Progress()
    result = compare(read(first), read(second), names, alpha, progress.at)
    progress.end()
    ways = worst(result)
    print("\n".join(tables(result, ways)))
    jobs = {"worst_of_second": [asdict(w) for w in ways[0]], "worst_of_first": [asdict(w) for w in ways[1]]}
    write_results(document(result) | jobs, json_out, html_out, lambda: _page(result, ways))
    if fail_on and not result.judged and result.unjudged:
        raise InputError("no comparison could be judged, for too few worlds", key="--fail-on",
                         hint="run both campaigns with more seeds or lots, or choose fewer --figures")  # fmt: skip
    found = [c for c in result.claims if fail_on == "any" or c.verdict == WORSE]
    return Status.STOPPED if fail_on and found else Status.DONE


def _page(result: Result, ways: tuple[list[Worst], list[Worst]]) -> str:
    from sim_ecu.campaign.comparison.page import page

    return page(result, ways)
