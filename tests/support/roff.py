"""Manual pages as troff's man macros: text is escaped here, and nowhere else."""

import re
import textwrap
from collections.abc import Iterable
from pathlib import Path

from wrcd import __version__

WIDTH = 72  # of a line of the source, before its escapes
MAX_BYTES = 80  # of a line, from which on mandoc's lint complains
CHANGELOG = Path(__file__).parents[2] / "CHANGELOG.md"
NO_BREAK = "\0"
CODE = re.compile(r"`([^`]+)`")
# A minus that can be copied, quotes that stay straight; … is told apart from the end of a sentence.
ESCAPES = {
    "\\": "\\e", "-": "\\-", "'": "\\(aq", "`": "\\(ga", "~": "\\(ti", "^": "\\(ha", "…": ".\\|.\\|.\\&", "–": "\\(en",
    "—": "\\(em", "·": "\\(pc", "×": "\\(mu", "≤": "\\(<=", "≥": "\\(>=", "²": "\\(S2", "µ": "\\(mc", "±": "\\(+-",
}  # fmt: skip


def escaped(text: str) -> str:
    """Text as it is to appear, not taken for a macro at a line's begin. Raises ValueError for what has no escape."""
    out = "".join(ESCAPES.get(c, c) for c in text)
    if not out.isascii():
        raise ValueError(f"no escape for {[c for c in out if not c.isascii()]} in {text!r}")
    return f"\\&{out}" if out.startswith(".") else out


def bold(text: str) -> str:
    """What is typed as it stands."""
    return f"\\fB{escaped(text)}\\fR"


def italic(text: str) -> str:
    """What stands for something else."""
    return f"\\fI{escaped(text)}\\fR"


def paragraph(text: str) -> list[str]:
    """Lines of a paragraph, a sentence's end at a line's end; `code` is bold, and not broken."""
    whole = CODE.sub(lambda m: m[0].replace(" ", NO_BREAK), text)
    sentences = re.split(r"(?<=[.!?]) (?=\S)", whole)
    return [line for s in sentences for line in _wrapped(s)]


def _wrapped(sentence: str) -> list[str]:
    """Its lines; escapes may add to WIDTH as much as mandoc takes without a word."""
    lines: list[str] = []
    for width in range(WIDTH, WIDTH // 2, -2):
        broken = textwrap.wrap(sentence, width, break_long_words=False, break_on_hyphens=False)
        lines = [_marked(line.replace(NO_BREAK, " ")) for line in broken]
        if max(map(len, lines), default=0) <= MAX_BYTES:
            break
    return lines


def _marked(text: str) -> str:
    parts = CODE.split(text)
    # a hyphen between letters is one, and may end a line
    plain = (re.sub(r"(?<=[a-z])\\-(?=[a-z])", "-", escaped(part)) for part in parts[::2])
    code = (bold(part) for part in parts[1::2])
    return "".join(part for pair in zip(plain, (*code, ""), strict=True) for part in pair)


def item(tag: str, body: Iterable[str]) -> list[str]:
    """A tagged paragraph. tag and body are made already."""
    return [".TP", tag, *body]


def verbatim(lines: Iterable[str], indent: int = 4) -> list[str]:
    """Lines as they stand. They are made already."""
    return [f".RS {indent}", ".nf", *lines, ".fi", ".RE"]


def released() -> str:
    """The day of this version in the changelog; empty, as troff writes it, if there is none."""
    found = re.search(rf"^## {re.escape(__version__)} - (\S+)$", CHANGELOG.read_text(encoding="utf-8"), re.MULTILINE)
    return found[1] if found else '""'


def page(name: str, section: int, body: Iterable[str]) -> str:
    """The whole page, with the date of this version."""
    head = [f'.TH {name.upper()} {section} {released()} "wrcd {__version__}" "Manual of wrcd"', ".nh", ".ad l"]
    return "\n".join([*head, *body]) + "\n"
