"""wrcd.toml(5), made from the declared keys, and wrcd-frames(7), made from the DBC and the list of causes."""

from collections.abc import Iterable

from tests.support.pages import NUMBERED, _first_axle, _ids
from tests.support.roff import bold, escaped, italic, item, page, paragraph, verbatim
from wrcd import declared, resources
from wrcd.bus.dbc import Message, Signal, load_dbc, timeout_ms
from wrcd.core.causes import Cause
from wrcd.core.vocabulary import MESSAGES
from wrcd.keys import Key
from wrcd.tools.parser import sentence

TABLES = {
    "bus": "The bus of the daemon, and of the tools.",
    "dbc": "The network's description.",
    "estimator": "The design.",
    "vehicle": "What all axles share, and the messages of the daemon itself.",
    "limits": "From when on there is an estimate.",
    "axle": "Once for each wheelset.",
    "fusion": "A drop of adhesion that a leading axle meets is told for those behind it. Off unless it is given.",
    "recorder": "What is kept of the bus, and written when something happens.",
}
EXAMPLE = """[bus]
channel = "can0"

[dbc]
file = "train.dbc"

[wheelset]
name = "default"

[vehicle]
speed = "TCMS.Speed"

[[axle]]
number = 1
yaw_rate = { signal = "Bogie1.GyroZ", sign = -1, unit = "deg/s" }
lateral_acceleration = "Bogie1.AccelY"
torque = { signal = "TCU1.Motor", at = "motor", gear_ratio = 4.6 }
adhesion = "WSP_Adhesion1"
"""
VALIDITY = (
    ("Valid", "The estimate may be used, with its interval (Confidence)."),
    ("Degraded", "There is an estimate. It must not be relied on: act as without one."),
    ("NotAvailable", "There is no estimate: act as without one."),
)


def toml() -> str:
    """wrcd.toml(5)."""
    body = [".SH NAME", "wrcd.toml \\- configuration of wrcd", ".SH DESCRIPTION"]
    body += paragraph(
        "One TOML file, named by `--config`. Without one the packaged network with four axles holds. It is read "
        "strictly: an unknown key, a wrong type or a value out of range is an error with file, line, key and a "
        "suggestion, and all mistakes are said at once. Paths are relative to the file's folder. `wrcd check --config "
        "FILE` says what the file would run; `wrcd init` proposes one for a DBC."
    )
    body += [".PP", *paragraph("Keys marked `reload` are taken over by SIGHUP; all others need a restart.")]
    body += [".SH TABLES"]
    for name, keys in declared.TABLES.items():
        title = f"[[{name}]]" if name == "axle" else f"[{name}]"
        body += [f'.SS "{title}"', *paragraph(TABLES[name]), *_keys(keys)]
    body += ['.SS "[wheelset]"']
    body += paragraph(
        "Any key of the design's wheelset, `name` among them. What it states is compared with the design, and a "
        "design for another wheelset is refused. A configuration with a DBC of its own must have this table or "
        "`estimator.design`."
    )
    body += [".SH A SIGNAL THAT IS READ"]
    body += paragraph(
        '`yaw_rate = "Message.Signal"` is the short form. A table says what the DBC lacks or has otherwise:'
    )
    every = {key.name: key for keys in declared.INPUTS.values() for key in keys}
    body += _keys(every[key.name] for key in (*declared.TORQUE_INPUT, declared.REVERSE))
    body += [".SH A MESSAGE THAT IS SENT"]
    body += paragraph(
        '`adhesion = "WSP_Adhesion1"` is the short form: its signals have the names of `wrcd-frames`(7). A table '
        'gives others, by those names in small letters: `mu_available = { signal = "Friction", not_available = 255 }`.'
    )
    body += _keys(declared.output_keys("adhesion")[: -len(MESSAGES["adhesion"])])
    body += [".PP", *paragraph("Of each signal:")]
    body += _keys(declared.field_keys(MESSAGES["adhesion"]["MuAvailable"]))
    body += [".SH EXAMPLE", *verbatim(escaped(line) or "\\&" for line in EXAMPLE.splitlines())]
    body += [".SH SEE ALSO", *paragraph("`wrcd`(1), `wrcd-frames`(7)")]
    return page("wrcd.toml", 5, body)


def _keys(keys: Iterable[Key]) -> list[str]:
    out = []
    for key in keys:
        default = key.shown_default
        facts = [f"Takes {key.takes.replace(' … ', ' to ')}."]
        if key.needed:
            facts.append("Needed.")
        elif default != "–":
            facts.append(f"Default: {default}.")
        if key.reload:
            facts.append("`reload`")
        out += item(bold(key.name), [*paragraph(f"{sentence(key.what)}"), ".br", *paragraph(" ".join(facts))])
    return out


def frames() -> str:
    """wrcd-frames(7)."""
    body = [".SH NAME", "wrcd-frames \\- the CAN frames of wrcd", ".SH DESCRIPTION"]
    body += paragraph(
        "The packaged network: classical CAN, standard ids, Intel byte order. A train's own DBC gives other names, "
        "ids, units and words; see `wrcd.toml`(5). Every message is under AUTOSAR E2E Profile 11: the CRC in byte 0, "
        "the counter in the low nibble of byte 1. A receiver takes a message for lost after three cycles."
    )
    body += [".SH WHAT A CONSUMER DOES"]
    for name, what in VALIDITY:
        body += item(bold(name), paragraph(what))
    body += [".PP", *paragraph("A frame whose CRC or counter is wrong, or that is late, is NotAvailable.")]
    body += [".SH CAUSES", *paragraph("AdhesionDetail says why an axle is not Valid:")]
    for cause in Cause:
        if cause:
            body += item(bold(f"{cause:d} {cause.label}"), paragraph(sentence(cause.words)))
    body += [".SH MESSAGES"]
    groups: dict[str, list[Message]] = {}
    for m in sorted(load_dbc(resources.DBC).messages, key=lambda m: m.name):
        groups.setdefault(NUMBERED.sub("_A", m.name), []).append(m)
    for name, group in sorted(groups.items(), key=lambda g: g[1][0].frame_id):
        body += _message(name, group)
    body += [".SH SEE ALSO", *paragraph("`wrcd`(1), `wrcd.toml`(5), `candump`(1)")]
    return page("wrcd-frames", 7, body)


def _message(name: str, group: list[Message]) -> list[str]:
    first, several = group[0], len(group) > 1
    what = _of_all(first.comment or "") if several else first.comment or ""
    axles = f" for the axles a = 1 to {len(group)}" if several else ""
    timeout = max(filter(None, (timeout_ms(first, s) for s in first.signals)), default=None)
    facts = [
        f"Id {_ids([m.frame_id for m in group]).replace(' … ', ' to ')}{axles}, {first.length} bytes.",
        f"Sent by {', '.join(first.senders)} every {first.cycle_time} ms"
        + (f", stale after {timeout} ms." if timeout else "."),
    ]
    out = [
        f".SS {escaped(name)}{italic('a') if several else ''}",
        *paragraph(sentence(what)),
        ".br",
        *paragraph(" ".join(facts)),
    ]
    for s in sorted(first.signals, key=lambda s: s.start):
        out += item(_tag(s), paragraph(_signal(s, _of_all(s.comment or "") if several else s.comment or "")))
    return out


def _tag(s: Signal) -> str:
    return (
        f"{bold(s.name)} {italic(f'bits {s.start} to {s.start + s.length - 1}' if s.length > 1 else f'bit {s.start}')}"
    )


def _signal(s: Signal, comment: str) -> str:
    unit = f" {s.unit}" if s.unit else ""
    parts = [sentence(comment)]
    if not s.choices or s.scale != 1 or s.unit:
        step = "" if s.scale == 1 and not s.unit else f", in steps of {s.scale:g}{unit}"
        parts.append(f"{s.minimum} to {s.maximum}{step}{', signed' if s.is_signed else ''}.")
    if s.choices:
        parts.append(", ".join(f"{raw} {word}" for raw, word in sorted(s.choices.items())) + ".")
    return " ".join(parts)


def _of_all(comment: str) -> str:
    return _first_axle(comment).replace("*a*", "a")
