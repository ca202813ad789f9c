"""`wrcd check`: what a configuration would run."""

from wrcd.bus.dbc import Message, find_message, find_signal
from wrcd.bus.frame import GROUP, id_text
from wrcd.bus.positions import message_key
from wrcd.bus.signals import Output, OutputSignal, Source, StatusRule
from wrcd.bus.units import Quantity
from wrcd.config import declared
from wrcd.config.raw_values import words
from wrcd.core.configuration import LOAD_SHARES, RADIUS_SHARES, Config, Input
from wrcd.core.design import Design

# what of a wheelset a person knows it by, as the rig names it
KNOWN_BY = (
    ("r_0", "wheel radius", "m"),
    ("gamma", "conicity", ""),
    ("m_w", "mass", "kg"),
    ("k_w", "yaw stiffness", "N·m/rad"),
)


def describe(c: Config) -> list[str]:
    """Lines for a person."""
    d = c.design
    out = [
        f"configuration  {c.file}",
        f"bus            {c.interface} {c.channel}",
        f"DBC            {c.dbc_file} ({len(c.database.messages)} messages)",
        f"design         {c.design_file}: {d.name}, {d.checksum[:12]}, {len(d.rules)} rules",
        f"               tick {1000 * d.tick_s:g} ms, window {d.window_s:g} s, "
        f"{d.speeds_m_s[0]:g} … {d.speeds_m_s[-1]:g} m/s",
        f"               models: {'; '.join(d.model_names)}",
        f"wheelset       {made_for(d)}",
        *(f"{'' if k else 'worlds':14} {world}" for k, world in enumerate(d.worlds)),
        *(["sensors        not judged: the design has no part for it"] if d.health is None else []),
        f"limits         not available after {c.not_available_after_us / 1000:g} ms and below {c.min_speed_m_s:g} m/s"
        + (f", constant speed {c.constant_speed_m_s:g} m/s" if c.constant_speed_m_s is not None else ""),
    ]
    out += ["axles          on one rail share their words"] if c.fuses else []
    beside = {place: c.axles[other].number for pair in c.bogies for place, other in (pair, pair[::-1])}
    for place, axle in enumerate(c.axles):
        out.append(f"axle {axle.number}")
        if axle.position_m is not None:
            shares = f"shares a bogie with axle {beside[place]}" if place in beside else "no other axle in its bogie"
            of_bogie = f", {shares}" if d.is_bogie else ""
            out.append(f"  {declared.POSITION.name:22} {axle.position_m:g} m along the train{of_bogie}")
        out += [line for i in c.inputs if place in i.source.axles for line in _input(c, i)]
        for o in axle.sent:
            out += [] if o is None else [f"  sends                  -> {_sent(c, o)}", *_names(c, o)]
    for o in (c.status, c.rejects, c.link):
        out += [] if o is None else [f"status                   -> {_sent(c, o)}", *_names(c, o)]
    r = c.recorder
    out.append(
        f"recorder       the last {r.seconds:g} s, dumps in {r.folder} (at most {r.max_files}, {r.max_mb:g} MB)"
        if r.on
        else "recorder       none" + (" ([recorder] names no folder)" if r.folder is None else "")
    )
    out += [f"warning        {warning}" for warning in c.warnings]
    out.append("ok")
    return out


def _input(c: Config, i: Input) -> list[str]:
    """One signal that is read, and what the configuration says of it."""
    s = i.source
    m = find_message(c.database, s.message)
    data_id = c.data_ids.get(s.message)
    facts = [
        *_conversion(s, find_signal(m, s.signal).unit),
        *([] if s.low is None or s.high is None else [f"{s.low:g} … {s.high:g}"]),
        *([f"invalid {_raws(m, s.signal, s.invalid)}"] if s.invalid else []),
        *([] if s.reverse is None else [f"reverse {_raws(m, s.signal, s.reverse)}"]),
        f"stale after {i.timeout_us / 1000:g} ms",
        *([] if data_id is None else [f"E2E data id 0x{data_id:X}"]),
    ]
    name = s.quantity.key if s.part == 0 else "+"
    return [
        f"  {name:22} <- {id_text(message_key(m) | GROUP * s.pgn)} {s.message}.{s.signal} ({facts[0]}), "
        f"{', '.join(facts[1:])}{_bounds(s.quantity, c.design)}",
        *(f"  {'':22}    if {_rule(c, rule)}" for rule in s.statuses),
    ]


def _conversion(s: Source, unit: str | None) -> list[str]:
    """Unit, and what turns it into SI units at the axle where the DBC's unit does not say it."""
    own = [] if s.scale is None else [f"scale {s.scale:g}"]
    own += [] if s.offset is None else [f"offset {s.offset:g}"]
    own += [] if s.factor is None else [f"times {s.factor:g} to {s.quantity.unit}"]
    return [unit or "no unit in the DBC", *own]


def _rule(c: Config, rule: StatusRule) -> str:
    m = find_message(c.database, rule.message)
    degraded = f", degraded if {_raws(m, rule.signal, rule.degraded)}" if rule.degraded else ""
    return f"{rule.message}.{rule.signal} is {_raws(m, rule.signal, rule.ok)}{degraded}"


def _raws(m: Message, signal: str, raws: frozenset[int]) -> str:
    """Raw values with their words: 1 (Ok), 3."""
    known = words(find_signal(m, signal))
    return ", ".join(f"{raw} ({known[raw]})" if raw in known else str(raw) for raw in sorted(raws))


def _names(c: Config, o: Output) -> list[str]:
    """The names, units and words of what is sent, where they are not ours."""
    m = find_message(c.database, o.message)
    fields = [text for ours, s in o.signals.items() if (text := _field(m, ours, s))]
    return [f"  {'':22}    {text}" for text in fields]


def _field(m: Message, ours: str, s: OutputSignal) -> str:
    known = {word: raw for raw, word in words(find_signal(m, s.name)).items()}
    own = [f"{word} {raw}" for word, raw in (s.words or {}).items() if known.get(word) != raw]
    own += [] if s.factor == 1.0 else [f"times {s.factor:g}"]
    own += [] if s.low is None else [f"{s.low:g} … {s.high:g}"]
    if s.not_available is not None and known.get("NotAvailable") != s.not_available:
        own.append(f"not available {s.not_available}")
    if s.name == ours and not own:
        return ""
    return f"{ours} in {s.name}" + (f": {', '.join(own)}" if own else "")


def _sent(c: Config, o: Output) -> str:
    data_id = "" if o.data_id is None else f", E2E data id 0x{o.data_id:X}"
    key = message_key(find_message(c.database, o.message))
    return f"{id_text(key)} {o.message}, every {o.cycle_us / 1000:g} ms{data_id}"


def made_for(d: Design) -> str:
    """The design's wheelset by name and parameters: a foreign one gives no error."""
    known = [
        f"{what} {d.wheelset[key]:g} {unit}".rstrip()
        for key, what, unit in KNOWN_BY
        if isinstance(d.wheelset.get(key), int | float)
    ]
    return f"{d.wheelset.get('name', d.name)}: {', '.join((f'axle load {2e-3 * d.normal_N:.4g} kN', *known))}"


def _bounds(quantity: Quantity, d: Design) -> str:
    if quantity is Quantity.AXLE_LOAD:
        return "; Degraded outside {:.4g} … {:.4g} kN".format(*(2e-3 * d.normal_N * s for s in LOAD_SHARES))
    if quantity is Quantity.WHEEL_RADIUS:
        return "; Degraded outside {:.3g} … {:.3g} m".format(*(d.r_0 * s for s in RADIUS_SHARES))
    return ""
