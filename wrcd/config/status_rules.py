"""Which signals tell whether the sender of an input is well.

A frame is accepted whole or not at all: what one input says of a status that every frame has holds for all inputs of
the message. What lies in one branch of a multiplexer is of the inputs of that branch alone.
"""

from collections.abc import Mapping, Sequence

from wrcd.bus.dbc import DEFAULT_TIMEOUT_MS, Database, Message, Signal, find_message, timeout_ms
from wrcd.bus.mapping import STATUS
from wrcd.bus.positions import MAX_BITS, Branch, branch
from wrcd.bus.signals import StatusRule
from wrcd.bus.words import degraded, tells_status, unusable, usable
from wrcd.config import declared
from wrcd.config.input_mapping import check_readable, find
from wrcd.config.raw_values import raw_values, words
from wrcd.config.section import TO_FILL_IN
from wrcd.config.statements import Statement, StatusStatement


def status_rules(
    of_message: Sequence[Statement], database: Database, warnings: list[str]
) -> Mapping[str, tuple[StatusRule, ...]]:
    """The rules of each signal of one message, by what its inputs say of it, else by the DBC's words. Mistakes are
    collected."""
    message = find_message(database, of_message[0].message)
    if any(s.status_wrong for s in of_message):
        return {}
    branches = {s.name: branch(message, s.name) for s in message.signals}
    stated: dict[tuple[str, str], tuple[StatusRule, Statement]] = {}
    of_signal: dict[str, list[StatusRule]] = {s.signal: [] for s in of_message if s.signal in branches}
    for s in of_message:
        if s.status is None:
            continue
        rule = _stated_rule(s, s.status, database)
        if s.signal not in branches:
            continue  # stated of the signal
        _check_branch(s, rule, message, branches)
        known = stated.setdefault((rule.message, rule.signal), (rule, s))
        if known[0] != rule:
            raise s.table.error(
                f"takes other values of {rule.message}.{rule.signal} for good than {known[1].table.name}",
                declared.STATUS.name,
            )
        of_signal[s.signal].append(rule)
        for name, rules in of_signal.items():
            holder = rule.signal if rule.message == message.name else s.signal
            if branches[holder].covers(branches[name]):
                rules.append(rule)
    of_message = [s for s in of_message if s.signal in branches]
    for s in of_message:
        if s.status_off and of_signal[s.signal]:
            named = next(t for rule, t in stated.values() if rule in of_signal[s.signal])
            raise s.table.error(
                f"is false, but {named.table.name} names the status of {s.message}", declared.STATUS.name
            )
    silent = [s for s in of_message if not of_signal[s.signal]]
    usual = _usual_rules(silent, of_message, message, branches, warnings)
    return {name: tuple(dict.fromkeys(rules or usual.get(name, []))) for name, rules in of_signal.items()}


def _check_branch(s: Statement, rule: StatusRule, message: Message, branches: Mapping[str, Branch]) -> None:
    """Raises InputError for a status of frames that never carry the signal: it tells of another sensor."""
    if rule.message != message.name or not branches[rule.signal].excludes(branches[s.signal]):
        return
    own = [x.name for x in message.signals if _is_status(x) and x.name != s.signal]
    own = [f"{message.name}.{name}" for name in own if branches[name].covers(branches[s.signal])]
    raise s.table.error(
        f"{message.name}.{rule.signal} comes in frames with {branches[rule.signal]}, and {s.signal} in those with "
        f"{branches[s.signal]}: it says nothing of them",
        declared.STATUS.name,
        f"{' or '.join(own)} comes with it" if own else "name one that comes in the same frames",
    )


def _stated_rule(s: Statement, stated: StatusStatement, database: Database) -> StatusRule:
    key = declared.STATUS.name
    message, signal = find(s.table, key, database, stated.message, stated.signal)
    try:
        check_readable(message, signal)
        timeout_us = 1000 * (stated.timeout_ms or 0)
        if message.name != s.message:
            timeout_us = timeout_us or 1000 * (timeout_ms(message, signal) or DEFAULT_TIMEOUT_MS)
    except ValueError as e:
        raise s.table.error(str(e), key) from None
    usual_ok, usual_degraded = usual_values(signal)
    ok = usual_ok if stated.ok is None else raw_values(s.table, declared.OK.name, signal, stated.ok)
    degraded = (
        usual_degraded - ok
        if stated.degraded is None
        else raw_values(s.table, declared.DEGRADED.name, signal, stated.degraded)
    )
    if not ok:
        known = ", ".join(words(signal).values())
        raise s.table.error(
            f"{message.name}.{signal.name} has no word that is known to be good",
            key,
            f"say which{' of ' + known if known else ' raw values'}: {s.table.line(ok=[TO_FILL_IN])}",
        )
    if both := ok & degraded:
        raise s.table.error(f"{min(both)} is good already", declared.DEGRADED.name)
    return StatusRule(message.name, signal.name, ok, degraded, timeout_us)


def usual_values(signal: Signal) -> tuple[frozenset[int], frozenset[int]]:
    """Raw values that are good and degraded by the words of the value table."""
    table = words(signal)
    return (
        frozenset(raw for raw, word in table.items() if usable(word)),
        frozenset(raw for raw, word in table.items() if degraded(word)),
    )


def _usual_rules(
    silent: Sequence[Statement],
    of_message: Sequence[Statement],
    message: Message,
    branches: Mapping[str, Branch],
    warnings: list[str],
) -> dict[str, list[StatusRule]]:
    """By signal: its message's Status; else every signal whose name or words say that it is one. Only what is in every
    frame with the signal counts by itself."""
    measured = {s.signal for s in of_message}
    named = [x for x in message.signals if _is_status(x)]
    named = [x for x in named if x.name not in measured and not x.is_multiplexer]
    judged: dict[str, list[StatusRule]] = {}
    rules: dict[str, list[StatusRule]] = {}
    left: dict[str, str] = {}  # statuses that come in other frames, and of what
    for s in silent:
        own = branches[s.signal]
        off = [branches[t.signal] for t in of_message if t.status_off and branches[t.signal].covers(own)]
        mine = [x for x in named if branches[x.name].covers(own)]
        mine = [x for x in mine if x.name == STATUS] or mine
        mine = [x for x in mine if not any(branches[x.name].covers(t) for t in off)]
        for x in mine:
            if x.name not in judged:
                judged[x.name] = _usual_rule(s, x, warnings)
        rules[s.signal] = [rule for x in mine for rule in judged[x.name]]
        if not mine and not off:
            left |= {x.name: s.signal for x in named if x.name not in left}
    for name, signal in left.items():
        if name not in judged:
            warnings.append(
                f"{message.name}.{name} may say whether its sender is well, and does not count: it comes in frames "
                f"with {branches[name]}, and {signal} in {_frames(branches[signal])}"
            )
    return rules


def _is_status(signal: Signal) -> bool:
    return tells_status(signal.name, signal.unit, words(signal).values())


def _frames(of: Branch) -> str:
    return f"those with {of}" if of.conditions else "others, too"


def _usual_rule(s: Statement, signal: Signal, warnings: list[str]) -> list[StatusRule]:
    """The rule of a status that nobody names, if its words give one. A mistake is collected."""
    ok, degraded = usual_values(signal)
    name = f"{s.message}.{signal.name}"
    if not ok and signal.name == STATUS and not words(signal):
        ok = frozenset({0})  # without a value table only 0 is taken for good
    if ok and signal.length > MAX_BITS:
        reason = f"{name} is taken for its status and has {signal.length} bits, at most {MAX_BITS} are read"
        s.table.refuse(reason, declared.SIGNAL.name, s.table.line(status=False))
        return []
    if ok:
        return [StatusRule(s.message, signal.name, ok, degraded)]
    if signal.name == STATUS or any(unusable(word) for word in words(signal).values()):
        s.table.refuse(
            f"{name} tells of failures, and none of its words is known to be good "
            f"({', '.join(words(signal).values())})",
            declared.SIGNAL.name,
            f"{s.table.line(status=name, ok=[TO_FILL_IN])}, or status = false",
        )
    else:
        warnings.append(
            f"{name} may say whether its sender is well, and does not count: "
            "if it does, name it as the status of an input of that message, else say status = false"
        )
    return []
