"""The score as one page without anything outside it: verdict, pictures, tables; light and dark, narrow, on paper."""

import base64
import html
from collections.abc import Iterable, Sequence
from typing import Any

from sim_ecu.score.goals import MISSED, counted
from sim_ecu.score.page_pictures import LOOKS, Picture, pictures
from sim_ecu.score.page_style import STYLE
from sim_ecu.score.page_tables import sections
from sim_ecu.score.play import Trace
from sim_ecu.score.tables import QUICK, holes, tables

# the media of LOOKS, in the order in which a browser tries them; the last is for all others and for paper
MEDIA = (
    "screen and (prefers-color-scheme: dark) and (max-width: 40rem)", "screen and (prefers-color-scheme: dark)",
    "screen and (max-width: 40rem)",
)  # fmt: skip

MAX_LISTED = 15  # missed goals above the pictures; more are folded


def page(result: dict[str, Any], traces: Sequence[Trace]) -> str:
    """HTML, in English, with pictures inside."""
    name = html.escape(result["design"]["name"])
    loud = loud_lines(result, QUICK)
    lines = [line for line in tables(result) if line not in loud]
    heading = f"How good is the design {name}?"
    return document(
        f"sim-ecu score: {name}", heading, loud, verdict(result["goals"]),
        pictures(result, traces), lines,
    )  # fmt: skip


def loud_lines(result: dict[str, Any], quick: str) -> list[str]:
    """What a page says first: that suites are left out, and that it is a quick one, in the words of `quick`."""
    return [*filter(None, holes(result)), *([quick] if result.get("run", {}).get("quick") else ())]


def document(
    title: str, heading: str, loud: Sequence[str], head: Sequence[str], shown: Iterable[Picture], lines: Sequence[str]
) -> str:
    """A page: heading, warnings (WORD: text), whose words begin the title, too, head (HTML), pictures, tables
    (Markdown's lines). title and heading are HTML already."""
    first, *rest = sections(lines)
    body = [f"<header><h1>{heading}</h1>"]
    for word, _, text in (line.partition(": ") for line in loud):
        body.append(f'<p class="loud" role="note"><strong>{word}</strong>: {html.escape(text)}</p>')
    body += [*head, "</header>", "<main>"]
    body += [_figure(picture) for picture in shown]
    links = "".join(f'<a href="#{_anchor(name)}">{html.escape(name)}</a> ' for name, _ in rest)
    body += [f'<nav aria-label="Tables">Tables: {links}</nav>', *first[1]]
    for name, part in rest:
        body += [f'<h2 id="{_anchor(name)}">{html.escape(name)}</h2>', *part]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{''.join(line.partition(':')[0] + ' ' for line in loud)}{title}</title>\n"
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n<body>\n'
        + "\n".join(body)
        + "\n</main></body></html>\n"
    )


def verdict(goals: Sequence[dict[str, Any]]) -> list[str]:
    """How many goals are met, and which are not."""
    out = [f"<p>{counted([g['verdict'] for g in goals], '<strong>{}</strong>')}</p>"]
    if missed := [g["what"] for g in goals if g["verdict"] == MISSED]:
        named = ["<ul>", *(f"<li>{html.escape(what)}</li>" for what in missed), "</ul>"]
        if len(missed) <= MAX_LISTED:
            out += ["<p>Missed:</p>", *named]
        else:
            out += [f"<details><summary>The {len(missed)} missed, by name</summary>", *named, "</details>"]
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
