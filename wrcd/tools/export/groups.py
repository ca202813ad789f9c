"""The groups of an exported file: a message that the daemon sends, an input, the changes of an axle's Validity."""

from collections.abc import Iterator

from wrcd.bus.dbc import find_message, find_signal
from wrcd.bus.signals import Output, Source
from wrcd.bus.units import Quantity
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.vocabulary import MESSAGES, Numeric, Words
from wrcd.tools.export.records import Channel, Group
from wrcd.tools.said import Said, said

# by key of the vocabulary: the name of the packaged DBC's message
NAMES = {
    "adhesion": "Adhesion", "detail": "AdhesionDetail", "inputs": "InputHealth", "ahead": "AdhesionAhead",
    "status_message": "WrcdStatus", "rejects_message": "WrcdRejects", "link_message": "WrcdLink",
}  # fmt: skip
INPUTS = {
    Quantity.YAW_RATE: "YawRate", Quantity.LAT_ACCEL: "LatAccel", Quantity.TORQUE: "Torque", Quantity.SPEED: "Speed",
    Quantity.BRAKE_TORQUE: "BrakeTorque", Quantity.AXLE_LOAD: "AxleLoad", Quantity.DIRECTION: "Direction",
    Quantity.WHEEL_RADIUS: "WheelRadius",
}  # fmt: skip
UNITS = {"m/s2": "m/s²", "N m": "Nm", "1": ""}  # of ours, as the field writes them
VALIDITIES = tuple(v.value for v in Validity)
CAUSES = tuple(c.label for c in Cause)


def sent_groups(config: Config) -> Iterator[tuple[Said, Group]]:
    """Each message that the daemon sends, and its group."""
    outputs = {o.message: o for o in _outputs(config)}
    for message in said(config, extra=True):
        kind = message.kind
        assert kind is not None
        of = f"_A{kind.axle}" if kind.axle else ""
        channels = tuple(_channel(config, outputs[message.name], kind.name, ours) for ours in message.names)
        about = f"frames of {message.name}, every {message.cycle_us / 1000:g} ms"
        yield message, Group(NAMES[kind.name] + of, channels, about, of)


def _outputs(config: Config) -> Iterator[Output]:
    of_axles = (o for a in config.axles for o in (a.adhesion, a.detail, a.inputs, a.ahead))
    yield from (o for o in (*of_axles, config.status, config.rejects, config.link) if o is not None)


def _channel(config: Config, output: Output, message: str, ours: str) -> Channel:
    what = MESSAGES[message][ours]
    signal = find_signal(find_message(config.database, output.message), output.signals[ours].name)
    comment = signal.comment or ""
    if isinstance(what, Words):
        return Channel(ours, words=(*what.words, *what.extra), comment=comment)
    assert isinstance(what, Numeric)
    return Channel(ours, what.unit, comment=comment)


def input_groups(config: Config) -> list[Group]:
    """A group for each mapped signal, in the order of the configuration's inputs."""
    sources = [i.source for i in config.inputs]
    parts = {(s.quantity, s.axles) for s in sources if s.part}
    out = []
    for s in sources:
        of = _whose(s, len(config.axles), config)
        if (s.quantity, s.axles) in parts:
            of += f"_{s.part + 1}"
        unit = UNITS.get(s.quantity.unit, s.quantity.unit)
        about = f"accepted frames of {s.message}.{s.signal}, at the axle: sign and gear ratio applied"
        out.append(Group(INPUTS[s.quantity] + of, (Channel(INPUTS[s.quantity], unit),), about, of))
    return out


def _whose(s: Source, axles: int, config: Config) -> str:
    """The axles of a source; nothing where it is the vehicle's."""
    if len(s.axles) == axles and s.quantity in (Quantity.SPEED, Quantity.DIRECTION):
        return ""
    return "".join(f"_A{config.axles[place].number}" for place in s.axles)


def change_group(axle: int) -> Group:
    """The changes of an axle's Validity, and why."""
    channels = (
        Channel("Validity", words=VALIDITIES, comment="from now on"),
        Channel("Cause", words=CAUSES, comment="of not being Valid"),
        Channel("Detail", is_text=True, comment="the input and its figures against their limits"),
    )
    of = f"_A{axle}"
    return Group(f"Changes{of}", channels, "a row for each change of Validity or of its cause", of)
