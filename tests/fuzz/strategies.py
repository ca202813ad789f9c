"""What the property tests draw from: frames near to and far from good ones, and texts with a few things wrong."""

import re
from collections.abc import Sequence

from hypothesis import strategies as st

from wrcd.bus.e2e import COUNTER_MODULO, protect
from wrcd.bus.frame import Frame

STAMPS = st.integers(-1_000_000_000_000_000, 10_000_000_000_000_000)
# What people and programs put where something else belongs: sizes that overflow, no numbers, empty and foreign text.
NASTY = (
    "", "0", "-1", "1", "2.5", "1e400", "-1e308", "1e-320", "nan", "inf", "9" * 30, "9" * 400, "true", "null", '"', "'",
    '""', '"x"', "[", "]", "[]", "{}", "{", "}", "[[", "]]", "=", ";", ":", "|", "@", "#", ",", ".", "\n", "\0", "\r",
    "\t", "é", "☃", "65536", "4294967296", "18446744073709551616", "-9223372036854775809", "2024-13-41", "1979-05-27",
    "0x1F", "m0", "M", "../x", "/", "x" * 300,
)  # fmt: skip
NUMBERS = (
    "0", "1", "-1", "2", "3", "7", "15", "16", "63", "64", "65", "255", "256", "0.3", "-0.5", "1e-320", "1e300",
    "1e400",
    "-1e400", "NaN", "65535", "65536", "2147483648", "4294967295", "9" * 19, "9" * 30,
)  # fmt: skip
EDITS = ("number", "replace", "insert", "drop", "double", "swap", "cut line", "double line")
_TOKEN = re.compile(r"\w+|\s+|.", re.DOTALL)


@st.composite
def mutated(draw: st.DrawFn, text: str, most: int = 4) -> str:
    """A text after one to `most` edits: pieces replaced, left out, doubled or exchanged, lines left out or doubled."""
    tokens = _TOKEN.findall(text)
    for _ in range(draw(st.integers(1, most))):
        at = draw(st.integers(0, len(tokens) - 1)) if tokens else 0
        kind = draw(st.sampled_from(EDITS))
        other = draw(st.sampled_from(NASTY) | st.sampled_from(tokens or [""]) | st.text(max_size=6))
        if kind == "number":
            numbers = [i for i, token in enumerate(tokens) if token.isdigit()]
            if numbers:
                tokens[numbers[at % len(numbers)]] = draw(st.sampled_from(NUMBERS))
        elif kind == "replace":
            tokens[at : at + 1] = [other]
        elif kind == "insert":
            tokens[at:at] = [other]
        elif kind == "drop":
            del tokens[at : at + draw(st.integers(1, 20))]
        elif kind == "double":
            tokens[at:at] = tokens[at : at + draw(st.integers(1, 20))]
        elif kind == "swap" and tokens:
            to = draw(st.integers(0, len(tokens) - 1))
            tokens[at], tokens[to] = tokens[to], tokens[at]
        else:
            tokens = _TOKEN.findall(_line_changed("".join(tokens), at, kind == "double line"))
    return "".join(tokens)


def _line_changed(text: str, at: int, double: bool) -> str:
    lines = text.splitlines(keepends=True) or [""]
    at %= len(lines)
    lines[at : at + 1] = [lines[at]] * (2 if double else 0)
    return "".join(lines)


EDITS_OF_BYTES = st.lists(
    st.tuples(
        st.sampled_from(("set", "flip", "insert", "drop", "cut off")), st.integers(0, 1 << 20), st.binary(max_size=8)
    ),
    min_size=1,
    max_size=6,
)


def damage(content: bytes, edits: list[tuple[str, int, bytes]]) -> bytes:
    """A file after a few edits of its bytes: changed, cut out, put in, cut off."""
    out = bytearray(content)
    for kind, place, data in edits:
        at = place % (len(out) + 1)
        if kind == "set":
            out[at : at + len(data)] = data
        elif kind == "flip":
            out[at : at + 1] = bytes(b ^ 1 << place % 8 for b in out[at : at + 1])
        elif kind == "insert":
            out[at:at] = data
        elif kind == "drop":
            del out[at : at + 1 + 8 * len(data)]
        else:
            del out[at:]
    return bytes(out)


def damaged(content: bytes) -> st.SearchStrategy[bytes]:
    """What becomes of a file."""
    return EDITS_OF_BYTES.map(lambda edits: damage(content, edits))


def any_frames(ids: Sequence[int]) -> st.SearchStrategy[Frame]:
    """Frames of these ids and of any other, of every kind and length."""
    number = st.sampled_from(ids) | st.integers(0, 0x1FFFFFFF)
    flag = st.booleans()
    return st.builds(Frame, STAMPS, number, st.binary(max_size=64), flag, flag, flag, flag)


@st.composite
def near_frames(draw: st.DrawFn, lengths: dict[int, int], protected: bool = True) -> Frame:
    """Frames of messages (id -> length) with any contents; where they are protected, most with a CRC that fits."""
    can_id = draw(st.sampled_from(sorted(lengths)))
    data = draw(st.binary(min_size=lengths[can_id], max_size=lengths[can_id]))
    if protected and draw(st.integers(0, 9)) < 9:
        status = draw(st.sampled_from((0, 0, 0, 1)) | st.integers(0, 15))
        data = protect(data[:1] + bytes((status << 4,)) + data[2:], can_id, draw(st.integers(0, COUNTER_MODULO)))
    return Frame(draw(STAMPS), can_id, data, extended=can_id > 0x7FF)
