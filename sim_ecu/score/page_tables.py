"""The score's tables and sentences as HTML: tables that become a card for each row where there is no room."""

import html
from collections.abc import Sequence

from sim_ecu.score.goals import MISSED

MAX_PLAIN_COLUMNS = 5  # a table with more is "wide": its rows become cards sooner


def sections(lines: Sequence[str]) -> list[tuple[str, list[str]]]:
    """The few forms that `tables` uses, **heading**: text, paragraphs and tables, by heading ("": what comes first)."""
    out: list[tuple[str, list[str]]] = [("", [])]
    rows: list[list[str]] = []
    for line in [*lines, ""]:
        if line.startswith("|"):
            rows.append([c.strip() for c in line.strip().strip("|").split("|")])
            continue
        if rows:
            out[-1][1].extend(table(rows[0], rows[2:]))
            rows = []
        if line.startswith("**"):
            name, _, rest = line[2:].partition("**")
            out.append((name, [f"<p>{html.escape(sentence(rest.lstrip(': ')))}</p>"]))
        elif line:
            out[-1][1].append(f"<p>{html.escape(line)}</p>")
    return out


def sentence(text: str) -> str:
    """With a capital letter and a full stop."""
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Every cell names its column, for a card has no head; a row that ends with a missed goal is marked."""
    names = [html.escape(name) for name in head]
    out = [f"<table{' class=wide' if len(head) > MAX_PLAIN_COLUMNS else ''}>", "<thead><tr>"]
    out += [f'<th scope="col">{name}</th>' for name in names]
    out.append("</tr></thead><tbody>")
    for row in rows:
        cells = [html.escape(cell) for cell in row]
        mark = ' class="missed"' if row[-1] == MISSED else ""
        first = f'<th scope="row">{cells[0]}</th>'
        rest = [f'<td data-of="{name}">{cell}</td>' for name, cell in zip(names[1:], cells[1:], strict=True)]
        out.append(f"<tr{mark}>{first}{''.join(rest)}</tr>")
    return [*out, "</tbody></table>"]
