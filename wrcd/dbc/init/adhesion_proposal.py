"""The message that tells the train its adhesion: which of its signals takes which of our values, word by word."""

from collections.abc import Callable, Iterable

from wrcd.bus.words import degraded, unusable, usable
from wrcd.config.outputs import ADHESION_MS, NEEDS
from wrcd.config.section import toml
from wrcd.core.vocabulary import MESSAGES, Words, snake
from wrcd.dbc.dbc_lines import DbcText, Message, Signal
from wrcd.dbc.init.proposal import Proposal
from wrcd.dbc.lint.message_checks import in_range
from wrcd.dbc.recognition import (
    ERROR,
    NOT_AVAILABLE,
    POOR,
    USED_PARTS,
    contains,
    is_adhesion,
    is_counter,
    is_crc,
    is_fraction,
    is_percent,
    is_status,
    letters,
    numbers,
    words,
)

CARRIED = MESSAGES["adhesion"]
WORDS = {name: (*carried.words, *carried.extra) for name, carried in CARRIED.items() if isinstance(carried, Words)}
NEEDED_WORDS = {name: carried.words for name, carried in CARRIED.items() if isinstance(carried, Words)}
# Our values with words: the signal's name in the packaged DBC, and parts of other names for it.
_NAMES = {
    "Confidence": ("conf", "vertrauen", "trust", "sicherheit"),
    "Surface": ("surface", "schiene", "railcond", "railstate"),
    "ContactState": ("contact", "kontakt", "slip", "schlupf"),
}
_AGE = ("age", "alter")


def propose_adhesion(draft: Proposal, dbc: DbcText, number: int, axles: int) -> None:
    """Write what axle `number` of so many sends."""
    found = [m for m in dbc.messages if is_adhesion(m)]
    mine = [m for m in found if numbers(m.name, "")[0] == number] or (found if axles == 1 else [])
    mine = [m for m in mine if _has_our_names(m)] or mine
    about = f"axle {number}, adhesion"
    if not mine:
        rest = f" ({', '.join(m.name for m in found[:5])})" if found else ""
        ways = f"name one that nobody else sends, or copy Adhesion_A{number} from wrcd.dbc into the DBC"
        what = f"no message looks like this axle's adhesion{rest}; {ways}"
        draft.add_todo(about, what, f"{draft.axle}.adhesion", 'adhesion = "Message"')
        return
    best, *others = mine
    if others:
        draft.doubt(about, f"{best.name} is chosen; it could be {', '.join(m.name for m in others)}")
    draft.doubt(about, f"the daemon will send it; in the DBC {best.sender} does. Nobody else may")
    if _has_our_names(best):
        draft.add(f"adhesion = {toml(best.name)}")
        return
    draft.add(f"adhesion.message = {toml(best.name)}")
    if not dbc.number(best, "GenMsgCycleTime"):
        draft.doubt(about, f"{best.name} has no cycle in the DBC: {ADHESION_MS} ms are taken")
        draft.add(f"adhesion.cycle_ms = {ADHESION_MS}")
    if not dbc.e2e_profile(best) and any(map(is_crc, best.signals)) and any(map(is_counter, best.signals)):
        draft.doubt(about, f"{best.name} has a CRC and a counter, but no E2EProfile")
        draft.add('# adhesion.e2e = "P11"', "# adhesion.data_id = 0")
    _percentages(draft, about, best)
    _validity(draft, about, best)
    _rest(draft, about, best)


def _has_our_names(m: Message) -> bool:
    """Whether the short form is enough: our names, our words."""
    signals = {s.name: s for s in m.signals}
    known = all(set(words) <= set(signals[name].labels) for name, words in NEEDED_WORDS.items() if name in signals)
    return known and set(NEEDS["adhesion"]) <= signals.keys()


def _percentages(draft: Proposal, about: str, m: Message) -> None:
    percent = [s for s in m.signals if is_percent(s) or is_fraction(s)]
    used = [s for s in percent if contains(s.name, USED_PARTS)]
    candidates = sorted((s for s in percent if s not in used), key=_is_not_available_adhesion)
    if not candidates:
        what, key = f"which signal of {m.name} is the available adhesion?", "adhesion.mu_available"
        draft.add_todo(about, what, f"{draft.axle}.{key}", f'{key} = "Signal"')
    else:
        available, *others = candidates
        if others:
            draft.doubt(about, f"{available.name} is taken for the available adhesion; there is {_names(others)}, too")
        _one_percentage(draft, about, "mu_available", m, available)
    for s in used[:1]:
        _one_percentage(draft, about, "mu_used", m, s)


def _is_not_available_adhesion(s: Signal) -> bool:
    return not contains(s.name, ("avail", "mu", "friction", "adhesion", "reibwert", "kraftschluss", "verfuegbar"))


def _names(signals: Iterable[Signal]) -> str:
    return ", ".join(s.name for s in signals)


def _one_percentage(draft: Proposal, about: str, key: str, m: Message, s: Signal) -> None:
    held = range(s.lowest_raw, s.highest_raw + 1)
    none = [raw for raw, w in s.words if unusable(w) and "err" not in letters(w) and raw in held]
    named = "NotAvailable" in s.labels
    table: dict[str, object] = {"signal": s.name}
    if is_fraction(s):
        table["unit"] = "1"
    if not named:
        table["not_available"] = none[0] if none else s.highest_raw
    line = f"adhesion.{key} = {toml(s.name if len(table) == 1 else table)}"
    if named or none:
        draft.add(line)
        return
    if not in_range(s, s.highest_raw):
        what = f"has no word for 'not available': is it {s.highest_raw}, the highest value?"
    else:
        what = "cannot say 'not available': every value of it is an adhesion"
    draft.add_todo(about, f"{s.path} {what}", f"{draft.axle}.adhesion.{key}", line)


def _validity(draft: Proposal, about: str, m: Message) -> None:
    """Our four words in theirs. A word that is missing must not be made up: a person says it."""
    states = [s for s in m.signals if (is_status(s) or contains(s.name, ("valid",))) and s.words]
    states = [s for s in states if not any(contains(s.name, parts) for parts in _NAMES.values())]
    if not states:
        what = f"which signal of {m.name} says whether the value may be used?"
        line = 'adhesion.validity = { signal = "Signal", valid = "…", degraded = "…", not_available = "…" }'
        draft.add_todo(about, what, f"{draft.axle}.adhesion.validity", line)
        return
    best = states[0]
    table: dict[str, object] = {"signal": best.name}
    for ours in WORDS["Validity"]:
        word = next((w for w in best.labels if _MEANS[ours](w)), None)
        if word is not None or ours in NEEDED_WORDS["Validity"]:
            table[snake(ours)] = "?" if word is None else word
    missing = [ours for ours, word in table.items() if word == "?"]
    line = f"adhesion.validity = {toml(table)}"
    if missing:
        what = f"which word of {best.path} ({', '.join(map(repr, best.labels))}) means {', '.join(missing)}?"
        draft.add_todo(about, what, f"{draft.axle}.adhesion.validity", line)
    else:
        draft.add(line)


_MEANS: dict[str, Callable[[str], bool]] = {
    "Valid": usable,
    "Degraded": lambda w: degraded(w) or letters(w) in POOR,
    "NotAvailable": lambda w: letters(w) in NOT_AVAILABLE,
    "Error": lambda w: letters(w) in ERROR,
}


def _rest(draft: Proposal, about: str, m: Message) -> None:
    """Optional values: only where all of our words are known; else as a comment."""
    ages = [
        s for s in m.signals
        if s.unit.strip() == "ms" and (set(_AGE) & set(words(s.name)) or contains(s.name, ("sampleage",)))
    ]  # fmt: skip
    if ages:
        if len(ages) > 1:
            draft.doubt(about, f"{ages[0].name} is taken for the sample age; there is {_names(ages[1:])}, too")
        draft.add(f"adhesion.sample_age = {toml(ages[0].name)}")
    for name, parts in _NAMES.items():
        named = [s for s in m.signals if contains(s.name, parts) and s.words]
        if not named:
            continue
        s = named[0]
        theirs = {letters(w): w for w in s.labels}
        table = {"signal": s.name} | {snake(w): theirs.get(letters(w), "?") for w in WORDS[name]}
        line = f"adhesion.{snake(name)} = {toml(table)}"
        if "?" in table.values():
            draft.doubt(about, f"{s.path} looks like {snake(name)}: fill in its words, or leave it out")
            draft.add(f"# {line}")
        else:
            draft.add(line)
