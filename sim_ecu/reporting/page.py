"""Sections of sentences, tables and pictures: one page of HTML without anything outside it, or Markdown.

A page is light or dark, from 320 px up, and can be printed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, TypeAlias, Union

from jinja2 import Environment, StrictUndefined

from sim_ecu.reporting.table import Table
from sim_ecu.reporting.values import text

if TYPE_CHECKING:  # a page without pictures does not wait for matplotlib
    from sim_ecu.reporting.plots import Picture


@dataclass(frozen=True, slots=True)
class Items:
    """A list of sentences."""

    items: Sequence[str]
    kind: ClassVar[str] = "items"


@dataclass(frozen=True, slots=True)
class Folded:
    """Details that a reader unfolds."""

    summary: str
    parts: Sequence["Part"]
    kind: ClassVar[str] = "folded"


Part: TypeAlias = Union[str, Items, Folded, Table, "Picture"]  # a str is a sentence


@dataclass(frozen=True, slots=True)
class PageSection:
    """A heading ("": what comes before all) and what stands below it. about: in words, after the heading."""

    name: str
    about: str = ""
    parts: Sequence[Part] = ()

    @property
    def anchor(self) -> str:
        """Name that links go to."""
        return self.name.lower().replace(" ", "-")

    @property
    def sentence(self) -> str:
        """What it is about, with a capital letter and a full stop."""
        return self.about[:1].upper() + self.about[1:] + ("" if self.about.endswith(".") else ".")


@dataclass(frozen=True, slots=True)
class Page:
    """Heading and head, warnings (WORD, text) whose words begin the title too, pictures, and sections behind links.

    links: what the sections are called, "" for none.
    """

    title: str
    heading: str
    sections: Sequence[PageSection]
    head: Sequence[Part] = ()
    loud: Sequence[tuple[str, str]] = ()
    pictures: Iterable["Picture"] = ()
    links: str = "Tables"


def html(page: Page) -> str:
    """Return the page as HTML, in English, with its pictures inside."""
    return _TEMPLATE.render(page=page, style=STYLE)


def markdown(sections: Iterable[PageSection]) -> list[str]:
    """Return the sections as lines of Markdown: sentences, lists and tables; what only a page can show is left out."""
    out: list[str] = []
    for section in sections:
        if section.name:
            out += ["", f"**{section.name}**" + f": {section.about}" * bool(section.about)]
        for k, part in enumerate(section.parts):
            if not isinstance(part, str | Items | Table):
                continue
            out += [""] if section.name or (k and not isinstance(part, str)) else []
            out += part.markdown() if isinstance(part, Table) else [part] if isinstance(part, str) else _listed(part)
    return out


def _listed(items: Items) -> list[str]:
    return [f"- {item}" for item in items.items]


STYLE = """
:root { --text: #1d2329; --back: #fff; --line: #c9d0d6; --soft: #f1f4f6; --missed: #fbd9d3; --loud: #b54708;
  color-scheme: light dark }
@media screen and (prefers-color-scheme: dark) {
  :root { --text: #dfe4e8; --back: #16191c; --line: #434b52; --soft: #21262b; --missed: #5e231d; --loud: #f79009 }
}
* { box-sizing: border-box }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 68rem; margin: 0 auto; padding: 1rem; color: var(--text);
  background: var(--back); overflow-wrap: anywhere }
h1 { font-size: 1.6rem; line-height: 1.25 } h2 { margin: 2.4rem 0 .4rem; font-size: 1.25rem }
a { color: inherit } nav { margin: 1rem 0 } nav a { margin-right: .8rem; white-space: nowrap }
figure { margin: 1.6rem 0 } img { display: block; width: 100%; height: auto }
figcaption { margin-top: .3rem }
.loud { border: 3px solid var(--loud); border-radius: .4rem; padding: .6rem 1rem; font-size: 1.1rem }
.loud strong { color: var(--loud) }
table { border-collapse: collapse; margin: .6rem 0 1.4rem; font-size: .87rem; max-width: 100% }
td, th { border: 1px solid var(--line); padding: .2rem .5rem; text-align: right; vertical-align: top; font-weight: 400;
  overflow-wrap: break-word }
thead th { background: var(--soft); font-weight: 600 } tr > :first-child, .text { text-align: left }
.missed { background: var(--missed) }
@media screen and (max-width: 40rem) { table, tbody, tr, td, tbody th { display: block } CARDS }
@media screen and (max-width: 68rem) { .wide, .wide tbody, .wide tr, .wide td, .wide tbody th { display: block } WIDE }
@media print {
  body { max-width: none; padding: 0; font-size: 10pt } nav { display: none }
  table { font-size: 6.5pt } td, th { padding: .1rem .2rem }
  figure, tr { break-inside: avoid } h2 { break-after: avoid }
}
"""
_CARD = """
  {of}thead {{ position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%) }}
  {of}tr {{ border: 1px solid var(--line); border-radius: .3rem; margin-bottom: .6rem; padding: .2rem .6rem }}
  {of}td, {of}tbody th {{ border: 0; padding: .1rem 0 }}
  {of}tbody th {{ font-weight: 600 }}
  {of}td {{ display: flex; justify-content: space-between; gap: 1rem }}
  {of}td::before {{ content: attr(data-of); text-align: left; opacity: .75 }}
  {of}td:empty, {of}tbody th:empty {{ display: none }}
"""
STYLE = STYLE.replace("CARDS", _CARD.format(of="")).replace("WIDE", _CARD.format(of=".wide "))

# Every cell names its column, for a card has no head.
_PAGE = """\
{%- macro css(classes) %}{% if classes %} class="{{ classes }}"{% endif %}{% endmacro %}
{%- macro rows(table) %}{% set all = table.records %}<table{% if table.wide %} class="wide"{% endif %}>
<thead><tr>{% for name in table.head %}<th scope="col"{{ css(all[0].cells[loop.index0] | css) if all }}>{{ name -}}
</th>{% endfor %}</tr></thead><tbody>
{% for row in all -%}
<tr{{ css(row.css) }}>{% for cell in row.cells -%}
{% if loop.first %}<th scope="row">{{ cell | shown }}</th>
{%- else %}<td data-of="{{ table.head[loop.index0] }}"{{ css(cell | css) }}>{{ cell | shown }}</td>{% endif -%}
{% endfor %}</tr>
{% endfor %}</tbody></table>
{% endmacro %}
{%- macro table(t) %}{% if t.title %}<p>{{ t.title }}</p>
{% endif %}{{ rows(t) }}{% if t.note %}<p>{{ t.note }}</p>
{% endif %}{% endmacro %}
{%- macro picture(p) %}{% set data = p.images() %}<figure><h2>{{ p.title }}</h2><picture>
{%- for medium, image in data[:-1] %}<source media="{{ medium }}" srcset="{{ image }}">{% endfor -%}
<img alt="{{ p.alt }}" src="{{ data[-1][1] }}"></picture><figcaption>{{ p.caption }}</figcaption></figure>
{% endmacro %}
{%- macro shown(part) %}{% if part is string %}<p>{{ part }}</p>
{% elif part.kind == "table" %}{{ table(part) }}{% elif part.kind == "picture" %}{{ picture(part) -}}
{% elif part.kind == "items" %}<ul>{% for item in part.items %}<li>{{ item }}</li>{% endfor %}</ul>
{% elif part.kind == "folded" %}<details><summary>{{ part.summary }}</summary>
{% for inner in part.parts %}{{ shown(inner) }}{% endfor %}</details>
{% endif %}{% endmacro -%}
<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="default-src 'none'; \
style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"><title>
{%- for word, _ in page.loud %}{{ word }} {% endfor %}{{ page.title }}</title>
<link rel="icon" href="data:,"><meta name="viewport" content="width=device-width, initial-scale=1">\
<style>{{ style | safe }}</style></head>
<body>
<header><h1>{{ page.heading }}</h1>
{% for word, text in page.loud %}<p class="loud" role="note"><strong>{{ word }}</strong>: {{ text }}</p>
{% endfor %}{% for part in page.head %}{{ shown(part) }}{% endfor %}</header>
<main>
{% for p in page.pictures %}{{ picture(p) }}{% endfor %}
{%- if page.links %}<nav aria-label="{{ page.links }}">{{ page.links }}:
{%- for s in page.sections if s.name %} <a href="#{{ s.anchor }}">{{ s.name }}</a>{% endfor %}</nav>
{% endif %}{% for s in page.sections %}{% if s.name %}<h2 id="{{ s.anchor }}">{{ s.name }}</h2>
{% endif %}{% if s.about %}<p>{{ s.sentence }}</p>
{% endif %}{% for part in s.parts %}{{ shown(part) }}{% endfor %}{% endfor %}</main></body></html>
"""


_ENVIRONMENT = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
_ENVIRONMENT.filters |= {"shown": text, "css": lambda cell: "text" if isinstance(cell, str) else ""}
_TEMPLATE = _ENVIRONMENT.from_string(_PAGE)
