"""A DBC's text before it is parsed: its encoding, sizes that would keep the parser busy, what to leave out."""

import re
from collections.abc import Callable, Collection
from pathlib import Path

from wrcd.errors import InputError

MAX_MULTIPLEXER_IDS = 200_000  # of a file: cantools takes 25 microseconds and half a kilobyte for each
# Message lengths, signal positions and powers of ten for which cantools would compute for hours.
# One by one: a pattern that begins with a literal is searched for ten times as fast.
_HUGE = tuple(
    re.compile(pattern, re.ASCII)
    for pattern in (
        r"BO_\s+\d+\s+\w+\s*:\s*\d{5}",
        r":\s*\d{6,}\s*\|",
        r"\|\s*\d{6,}\s*@",
        r"(?<![\w.])[\d.]+[eE]\+?\d{5}",
    )
)
# ids of one multiplexed signal, where numbers follow: the keyword alone stands in the list under NS_
_MULTIPLEXED = re.compile(r"SG_MUL_VAL_\s+\d+\s+\w+\s+\w+([\d\s,-]+)", re.ASCII)
_RANGE = re.compile(r"(\d+)\s*-\s*(\d+)", re.ASCII)
_STRING_OR_COMMENT = re.compile(r'"(?:\\"|[^"])*"|//[^\n]*')
# a line, or several where a string goes over them
_LINE = re.compile(r'(?:[^"\n]++|"(?:[^"\\]++|\\"|\\)*+")++\n?|\n')
_POWER = re.compile(r'"\s*[\d.]+[eE]\+?\d{6,}\s*"', re.ASCII)
_MESSAGE = re.compile(r"\bBO_\s+(\d+)\s+(\w+)\s*:", re.ASCII)
_SIGNAL = re.compile(r"\s*SG_\s+(\w+)[^:\"]*:\s*\d+\s*\|\s*([-+]?\d+)\s*@", re.ASCII)
EXTENDED = 1 << 31
_MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))


def read_text(path: Path, encoding: str | None) -> str:
    """Return a DBC's text, its lines ended by \\n.

    encoding: None takes the mark at the file's begin, UTF-8 where the file is valid UTF-8, else cp1252, in which a byte
    without a character becomes U+FFFD. Raises OSError, and InputError for an unknown encoding or a file that is not in
    the one given.
    """
    data = path.read_bytes()
    marked = next((name for mark, name in _MARKS if data.startswith(mark)), None)
    if encoding is None:
        text = _guessed(data, marked)
    else:
        try:
            # a mark is no part of the text, whatever the encoding is called
            text = data.removeprefix(_MARKS[0][0]).decode(encoding, "replace" if _is_cp1252(encoding) else "strict")
        except LookupError:
            raise InputError(f"unknown encoding {encoding!r}", key="encoding", hint="utf-8 or cp1252") from None
        except UnicodeDecodeError as e:
            line = data.count(b"\n", 0, e.start) + 1
            raise InputError(f"is not {encoding}", file=path, line=line, hint="name its encoding, or none") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _guessed(data: bytes, marked: str | None) -> str:
    if marked == "utf-16":
        return data.decode(marked, "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.removeprefix(_MARKS[0][0]).decode("cp1252", "replace")


def _is_cp1252(encoding: str) -> bool:
    return encoding.lower().replace("-", "").replace("_", "") in ("cp1252", "windows1252")


def huge_at(text: str) -> int | None:
    """Where a DBC's text names a size that no parser should try, or None. Strings and comments name none."""
    if not any(pattern.search(text) for pattern in _HUGE) and "SG_MUL_VAL_" not in text:
        return None
    bare = _STRING_OR_COMMENT.sub(_blank(text), text)
    found = next(filter(None, (pattern.search(bare) for pattern in _HUGE)), None)
    if found is not None:
        return found.start()
    ids = 0
    for signal in _MULTIPLEXED.finditer(bare):
        for low, high in _RANGE.findall(signal[1]):
            if len(low) > 18 or len(high) > 18:
                return signal.start()
            ids += max(int(high) - int(low) + 1, 0)
        if ids > MAX_MULTIPLEXER_IDS:
            return signal.start()
    return None


def _blank(text: str) -> Callable[[re.Match[str]], str]:
    """Blank a string or a comment, of one length and with its lines. A power of ten as an attribute's value stays."""

    def blank(m: re.Match[str]) -> str:
        if _POWER.fullmatch(m[0]) and text[text.rfind(";", 0, m.start()) + 1 : m.start()].lstrip().startswith("BA_"):
            return m[0]
        return re.sub(r"[^\n]", " ", m[0])

    return blank


def without_impossible_messages(text: str) -> tuple[str, dict[str, str]]:
    """Return a DBC's text without the messages that cantools refuses however lenient it is, and why, by name.

    That is a standard id of more than 11 bits, an extended one of more than 29, a signal without bits. Lines keep their
    numbers.
    """
    out: list[str] = []
    block: list[str] = []  # a message and its signals
    reasons: dict[str, str] = {}
    name = reason = ""

    def end_block() -> None:
        if reason:
            reasons[name] = reason
        out.append(_gap(block) if reason else "".join(block))
        block.clear()

    for line in _lines(text):
        if m := _MESSAGE.match(line.lstrip()):
            end_block()
            name, reason = m[2], _wrong_id(int(m[1]))
        elif line.strip() and line.split()[0] != "SG_":
            end_block()
            name = reason = ""
        elif name and (m := _SIGNAL.match(line)) and int(m[2]) <= 0:
            reason = reason or f"signal {m[1]} has no bits"
        block.append(line)
    end_block()
    return "".join(out), reasons


_ENUM = re.compile(r'^[ \t]*BA_DEF_\s+(?:\w+\s+)?"(\w+)"\s+ENUM\s+("[^;]*);', re.MULTILINE)
_GIVEN = re.compile(r'^([ \t]*BA_\s+"(\w+)"[^";]*)"([^"]*)"(\s*;)', re.MULTILINE)


def numbered_choices(text: str) -> str:
    """Return a DBC's text with the numbers of an ENUM's words where a BA_ states the word itself."""
    choices = {name: re.findall('"([^"]*)"', words) for name, words in _ENUM.findall(text)}

    def numbered(m: re.Match[str]) -> str:
        words = choices.get(m[2], [])
        return f"{m[1]}{words.index(m[3])}{m[4]}" if m[3] in words else m[0]

    return _GIVEN.sub(numbered, text)


def _wrong_id(can_id: int) -> str:
    number = can_id & (EXTENDED - 1)
    if can_id < EXTENDED:
        return f"standard id 0x{number:X} has more than 11 bits" if number > 0x7FF else ""
    return f"extended id 0x{number:X} has more than 29 bits" if number > 0x1FFFFFFF else ""


def without_statements(text: str, keyword: str, of: set[tuple[int, str]]) -> str:
    """Return a DBC's text without the statements `keyword ID SIGNAL …;` of some ids and signals. Lines keep their
    numbers."""
    pattern = re.compile(rf'\s*{keyword}\s+(\d+)\s+(\w+)\b(?:[^";]++|"(?:\\"|[^"])*+")*+;\s*', re.ASCII)
    return "".join(
        _gap([line]) if (m := pattern.fullmatch(line)) and (int(m[1]), m[2]) in of else line for line in _lines(text)
    )


def _lines(text: str) -> list[str]:
    lines: list[str] = _LINE.findall(text)
    return lines if sum(map(len, lines)) == len(text) else [text]  # a string without an end


def _gap(lines: list[str]) -> str:
    return "\n" * sum(line.count("\n") for line in lines)


# Attributes and comments of messages that nobody needs take half of the time to parse: with eight axles in the packaged
# DBC a twentieth of the time from start to READY. Left out is one usual statement, alone on its line.
_ABOUT = re.compile(
    r'(?:CM_|BA_ +"[^"]*") +(?:BO_|SG_) +(\d+)\b(?:[^";]++|"[^"]*+")*+;\s*',
)
# A comment may hide a quotation mark, a string hold one, and a message may be known by its long name.
_UNUSUAL = re.compile(r'//|\\"|SystemMessageLongSymbol')


def subset(text: str, names: Collection[str]) -> str:
    """Return a DBC's text with the statements about the messages in names, and with every message; lines keep their
    numbers. A text that cannot be cut for certain is returned whole."""
    # a string without an end: no line of it is certain. (Python 3.11.2 finds lines there that are none.)
    if text.count('"') % 2 or _UNUSUAL.search(text):
        return text
    found = _MESSAGE.findall(text)
    needless = {can_id for can_id, _ in found} - {can_id for can_id, name in found if name in names}
    return "".join(
        _gap([line]) if (m := _ABOUT.fullmatch(line)) and m[1] in needless else line for line in _lines(text)
    )
