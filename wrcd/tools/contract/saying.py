"""Checks of what a good frame says: Validity, numbers and classes that are none, SampleAge, Confidence."""

import itertools
from dataclasses import replace

from wrcd.core.causes import Validity
from wrcd.tools.contract.frames import DEGRADED, NOTHING, Says
from wrcd.tools.contract.player import BASE, Player, Seen, Sent
from wrcd.tools.contract.rules import CONFIDENCE, CONTACT, ORDER, SURFACE, VALIDITY, VALUES, Check, rule

State = Says | tuple[str, int]  # or a raw value of Validity with its name
CHECKS: list[Check] = []


@rule(CHECKS, ORDER)
def valid_is_used(p: Player) -> None:
    """A consumer that falls back for ever needs no wrcd; nor does one whose limit follows nothing."""
    p.must_reach(BASE)
    p.must_use(p.hold(BASE), f"{BASE}, frame after frame")
    p.must_reach(replace(BASE, mu_pct=40.0))


@rule(CHECKS, VALIDITY)
def degraded_falls_back(p: Player) -> None:
    """Its number is for people. Played as the daemon sends it, and with an interval, which it never has."""
    _falls_back(p, DEGRADED)
    _falls_back(p, replace(BASE, validity=Validity.DEGRADED))


@rule(CHECKS, VALIDITY)
def not_available_falls_back(p: Player) -> None:
    """There is no estimate; nor is there one where a damaged daemon sends a number with it."""
    _falls_back(p, NOTHING)
    _falls_back(p, replace(BASE, validity=Validity.NOT_AVAILABLE))


@rule(CHECKS, VALIDITY)
def unknown_validity_falls_back(p: Player) -> None:
    """A newer daemon, or a damaged one."""
    values = p.maker.unknown_validities()
    p.need(bool(values), "knows no other Validity")
    for name, raw in values:
        _falls_back_raw(p, "Validity", raw, f"Validity {name} with {BASE.mu_pct:g} %")


@rule(CHECKS, VALIDITY)
def every_transition_of_validity(p: Player) -> None:
    """Each state after each other one."""
    unknown = p.maker.unknown_validities()
    states: list[State] = [BASE, DEGRADED, NOTHING, *unknown[-1:]]
    p.settle()
    for before, after in _round_trip(len(states)):
        if after == 0:
            p.must_return(f"after {_name(states[before])}")
            continue
        played = f"{_name(states[after])} after {_name(states[before])}"
        p.must_fall_back(_hold(p, states[after]), played)


@rule(CHECKS, VALUES)
def not_available_number_falls_back(p: Player) -> None:
    """A frame that says Valid, and has no number."""
    _no_number(p, "not-available")


@rule(CHECKS, VALUES)
def error_number_falls_back(p: Player) -> None:
    """A frame that says Valid, and an error in the number's place."""
    _no_number(p, "error")


@rule(CHECKS, VALUES)
def number_beyond_100_percent_falls_back(p: Player) -> None:
    """No rail has that."""
    _no_number(p, "beyond")


@rule(CHECKS, VALUES)
def unknown_sample_age_falls_back(p: Player) -> None:
    """255 ms or older."""
    p.need(p.maker.has("SampleAge"), "has no SampleAge")
    _falls_back(p, replace(BASE, age_ms=255))


@rule(CHECKS, VALUES)
def high_sample_age_falls_back(p: Player) -> None:
    """Older than the consumer can bear, by its own bound."""
    p.need(p.maker.has("SampleAge"), "has no SampleAge")
    p.need(p.max_age_ms < 220, "says no SampleAge beyond the consumer's bound")
    _falls_back(p, replace(BASE, age_ms=min(p.max_age_ms + 40, 254)))


@rule(CHECKS, SURFACE)
def unknown_surface_falls_back(p: Player) -> None:
    """Valid without a class does not occur."""
    _unknown(p, "Surface")


@rule(CHECKS, CONTACT)
def unknown_contact_state_falls_back(p: Player) -> None:
    """Valid without an estimate does not occur."""
    _unknown(p, "ContactState")


@rule(CHECKS, CONFIDENCE)
def confidence_none_falls_back(p: Player) -> None:
    """Valid without an interval does not occur."""
    p.need(p.maker.has("Confidence"), "has no Confidence")
    _falls_back(p, Says(20.0, "None"))


@rule(CHECKS, CONFIDENCE)
def confidence_wider_changes_no_limit(p: Player) -> None:
    """No limit from it, none lifted."""
    p.need(p.maker.has("Confidence"), "has no Confidence")
    before = p.settle()
    for percent in (60.0, 14.0):
        says = Says(percent, "Wider")
        seen = p.hold(says, foul=True)
        p.must_ignore(seen, before, f"{says} after {BASE}")


def _falls_back(p: Player, says: Says) -> None:
    p.settle()
    p.must_fall_back(p.hold(says), f"{says} after {BASE}")
    p.must_return(f"after {says}")


def _falls_back_raw(p: Player, signal: str, raw: int, played: str) -> None:
    p.settle()
    seen = p.run(p.hold_us, lambda n, slot: [Sent(p.maker.with_raw(p.frame(slot), signal, raw))])
    p.must_fall_back(seen, f"{played} after {BASE}")
    p.must_return(f"after {played}")


def _unknown(p: Player, signal: str) -> None:
    p.need(p.maker.has(signal), f"has no {signal}")
    _falls_back_raw(p, signal, p.maker.word(signal, "Unknown"), f"Valid with {signal} Unknown")


def _no_number(p: Player, kind: str) -> None:
    values = [(words, raw) for of, words, raw in p.maker.no_numbers() if of == kind]
    p.need(bool(values), "has no such value of MuAvailable")
    for words, raw in values:
        _falls_back_raw(p, "MuAvailable", raw, f"Valid with {words}")


def _hold(p: Player, state: State) -> Seen:
    if isinstance(state, Says):
        return p.hold(state)
    raw = state[1]
    return p.run(p.hold_us, lambda n, slot: [Sent(p.maker.with_raw(p.frame(slot), "Validity", raw))])


def _name(state: State) -> str:
    return state.validity.value if isinstance(state, Says) else f"Validity {state[0]}"


def _round_trip(states: int) -> list[tuple[int, int]]:
    """From state 0 along every ordered pair of two states once, and back to it."""
    left = {(a, b) for a in range(states) for b in range(states) if a != b}
    path: list[int] = []

    def walk(at: int) -> None:  # Hierholzer's way to a round trip over all edges
        for to in range(states):
            if (at, to) in left:
                left.remove((at, to))
                walk(to)
        path.append(at)

    walk(0)
    return list(itertools.pairwise(reversed(path)))
