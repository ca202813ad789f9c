"""What a DBC's messages take of a classical CAN bus, from their lengths and cycles."""

from wrcd.bus.dbc import Database, Message, cycle_ms

BIT_RATES = (250_000, 500_000, 1_000_000)
MAX_LOAD_PCT = 80.0


def bits(payload: int, stuffed: bool) -> int:
    """Bits of a frame with a standard identifier and so many bytes, the three between two frames included.

    A stuff bit follows five equal bits: in the worst case one comes after the first five of the 34 + 8 n bits from
    start of frame to CRC, and after every further four.
    """
    covered = 34 + 8 * payload
    return covered + 13 + ((covered - 1) // 4 if stuffed else 0)


def frames_per_s(messages: list[Message]) -> float:
    """Of all the messages, each at its cycle."""
    return sum(1000 / (cycle_ms(m) or float("inf")) for m in messages)


def bits_per_s(messages: list[Message], stuffed: bool) -> float:
    """The same in bits."""
    return sum(bits(m.length, stuffed) * frames_per_s([m]) for m in messages)


def of_axles(production: Database, rig: Database | None, axles: int) -> list[Message]:
    """The messages of the first axles and those of the vehicle; with the rig's database, the truth too."""
    every = [*production.messages, *(rig.messages if rig else ())]
    return [m for m in every if "_A" not in m.name or int(m.name.rpartition("_A")[2]) <= axles]


def table(production: Database, rig: Database, max_axles: int) -> list[str]:
    """The table of docs/reference/messages.md: a line of Markdown each."""
    head = ["axles", "frames/s", *(f"{rate // 1000} kbit/s" for rate in BIT_RATES), "500 kbit/s with the truth"]
    out = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for axles in range(1, max_axles + 1):
        plain, with_truth = of_axles(production, None, axles), of_axles(production, rig, axles)
        cells = [_cell(plain, rate) for rate in BIT_RATES] + [_cell(with_truth, 500_000)]
        out.append("| " + " | ".join([str(axles), f"{frames_per_s(plain):.0f}", *cells]) + " |")
    return out


def _cell(messages: list[Message], rate: int) -> str:
    load = 100 * bits_per_s(messages, stuffed=True) / rate
    return f"{load:.0f}" if load <= MAX_LOAD_PCT else f"({load:.0f})"
