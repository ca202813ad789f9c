"""A comparison as one page without anything outside it, in the style of the score's."""

import html
from collections.abc import Sequence

from sim_ecu.campaign.comparison.compare import Result
from sim_ecu.campaign.comparison.pictures import pictures
from sim_ecu.campaign.comparison.tables import FIRST, SECOND, tables, verdict
from sim_ecu.campaign.comparison.worst import Worst
from sim_ecu.score.page import document


def page(result: Result, ways: tuple[Sequence[Worst], Sequence[Worst]]) -> str:
    """HTML, in English, with pictures inside."""
    told = verdict(result)
    head = [f"<p><strong>{html.escape(told)}</strong></p>"]
    for way, who in zip(ways, (SECOND, FIRST), strict=True):
        if way:
            head += [f"<details><summary>The {len(way)} worst jobs of the {who}, each as a CAMPAIGN.toml</summary>"]
            head += [
                f"<p>{html.escape(w.suite)}, {html.escape(w.figure)}</p><pre>{html.escape(w.toml)}</pre>" for w in way
            ]
            head += ["</details>"]
    lines = [
        line.replace("**", "").replace("`", "") if line.startswith("|") else line
        for line in tables(result, ways)
        if line != told
    ]
    names = " and ".join(html.escape(c.title or str(c.folder)) for c in (result.first, result.second))
    return document(
        f"sim-ecu compare: {names}", "What differs, and is it more than chance?", (), head, pictures(result), lines
    )
