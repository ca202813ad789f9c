"""The score as one page without anything outside it: verdict, pictures, tables; light and dark, narrow, on paper."""

import base64
import html
from collections import Counter
from collections.abc import Sequence
from typing import Any

from sim_ecu.score.goals import CHANCE, MET, MISSED, TOO_FEW
from sim_ecu.score.page_pictures import LOOKS, Picture, pictures
from sim_ecu.score.page_style import STYLE
from sim_ecu.score.page_tables import sections
from sim_ecu.score.play import Trace
from sim_ecu.score.tables import QUICK, tables

# the media of LOOKS, in the order in which a browser tries them; the last is for all others and for paper
MEDIA = (
    "screen and (prefers-color-scheme: dark) and (max-width: 40rem)", "screen and (prefers-color-scheme: dark)",
    "screen and (max-width: 40rem)",
)  # fmt: skip


def page(result: dict[str, Any], traces: Sequence[Trace]) -> str:
    """HTML, in English, with pictures inside."""
    name, quick = html.escape(result["design"]["name"]), bool(result.get("run", {}).get("quick"))
    first, *rest = sections([line for line in tables(result) if line != QUICK])
    body = [f"<header><h1>How good is the design {name}?</h1>"]
    if quick:
        head, _, text = QUICK.partition(": ")
        body.append(f'<p class="loud" role="note"><strong>{head}</strong>: {html.escape(text)}</p>')
    body += [*_verdict(result["goals"]), "</header>", "<main>"]
    body += [_figure(picture) for picture in pictures(result, traces)]
    links = "".join(f'<a href="#{_anchor(heading)}">{html.escape(heading)}</a> ' for heading, _ in rest)
    body += [f'<nav aria-label="Tables">Tables: {links}</nav>', *first[1]]
    for heading, lines in rest:
        body += [f'<h2 id="{_anchor(heading)}">{html.escape(heading)}</h2>', *lines]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{'QUICK ' * quick}sim-ecu score: {name}</title>\n"
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n<body>\n'
        + "\n".join(body)
        + "\n</main></body></html>\n"
    )


def _verdict(goals: Sequence[dict[str, Any]]) -> list[str]:
    """How many goals are met, and which are not."""
    n = Counter(g["verdict"] for g in goals)
    words = [
        (MET, "met"), (CHANCE, "missed within chance"), (MISSED, "missed"), (TOO_FEW, "with too few runs to judge"),
    ]  # fmt: skip
    counted = ", ".join(f"<strong>{n[verdict]}</strong> {text}" for verdict, text in words if n[verdict])
    out = [f"<p>Of {len(goals)} goal{'s' * (len(goals) != 1)} {counted}.</p>"]
    if missed := [g["what"] for g in goals if g["verdict"] == MISSED]:
        out += ["<p>Missed:</p><ul>", *(f"<li>{html.escape(what)}</li>" for what in missed), "</ul>"]
    return out


def _anchor(heading: str) -> str:
    return heading.lower().replace(" ", "-")


def _figure(p: Picture) -> str:
    """One picture in every look, of which a browser takes one."""
    data = [f"data:image/png;base64,{base64.b64encode(p.draw(look)).decode()}" for look in LOOKS]
    sources = "".join(f'<source media="{m}" srcset="{d}">' for m, d in zip(MEDIA, data[:-1], strict=True))
    return (
        f'<figure><h2>{html.escape(p.title)}</h2><picture>{sources}<img alt="{html.escape(p.alt)}" src="{data[-1]}">'
        f"</picture><figcaption>{html.escape(p.caption)}</figcaption></figure>"
    )
