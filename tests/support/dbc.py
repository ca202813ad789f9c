"""What a DBC tells of a message, to be compared."""

from wrcd.bus.dbc import Message


def told(m: Message) -> tuple[object, ...]:
    """All that is known of a message, down to its signals."""
    attributes = {k: v.value for k, v in m.dbc.attributes.items()} if m.dbc else {}
    signals = [
        (repr(s), s.start, s.length, s.comment, s.choices, {k: v.value for k, v in s.dbc.attributes.items()})
        for s in m.signals
        if s.dbc is not None
    ]
    return repr(m), m.cycle_time, m.senders, m.comment, attributes, signals
