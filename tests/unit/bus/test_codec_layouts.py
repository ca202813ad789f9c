"""Shift and mask against cantools: signals of any length, place, byte order and sign."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from wrcd.bus.codec import Receiver, SignalReader, Value, Writer
from wrcd.bus.dbc import Database, Message, find_message, parse_dbc
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source
from wrcd.bus.units import Quantity

CAN_ID = 800
SCALES = ("1", "0.01", "2.5", "-0.5", "0.000001", "3")
OFFSETS = ("0", "-40", "12.5", "1000")


@dataclass(frozen=True)
class Layout:
    """A message of random signals: its DBC, and its length in bytes."""

    text: str
    length: int
    names: tuple[str, ...]

    @property
    def database(self) -> Database:
        return parse_dbc(self.text, Path("layout.dbc"))


@st.composite
def layouts(draw: st.DrawFn, longest: int = 64, mixed: bool = True, unit: str = "m/s") -> Layout:
    """Signals one after another with gaps, in parts of whole bytes that are little or big endian."""
    length = draw(st.integers(1, 8))
    cut = draw(st.integers(0, length)) if mixed else 0
    lines: list[str] = []
    names: list[str] = []
    for first, end in ((0, cut), (cut, length)):
        little = draw(st.booleans())
        bit, bits = draw(st.integers(0, 7)), 8 * (end - first)
        while bit < bits:
            size = draw(st.integers(1, min(bits - bit, longest)))
            start = 8 * first + bit if little else 8 * (first + bit // 8) + 7 - bit % 8
            names.append(f"S{len(names)}")
            sign = draw(st.sampled_from("+-"))
            scale, offset = draw(st.sampled_from(SCALES)), draw(st.sampled_from(OFFSETS))
            lines.append(f' SG_ {names[-1]} : {start}|{size}@{int(little)}{sign} ({scale},{offset}) [0|0] "{unit}" B\n')
            bit += size + draw(st.integers(0, 9))
    text = f'VERSION ""\nNS_ :\nBS_:\nBU_: B\nBO_ {CAN_ID} M: {length} B\n{"".join(lines)}'
    return Layout(text, length, tuple(names))


def message_of(layout: Layout) -> Message:
    return find_message(layout.database, "M")


def decoded(message: Message, data: bytes, scaling: bool) -> dict[str, Any]:
    found = message.decode(data, decode_choices=False, scaling=scaling)
    assert isinstance(found, dict)
    return found


@given(layouts(), st.data())
def test_every_signal_is_decoded_as_by_cantools(layout: Layout, data: st.DataObject) -> None:
    message = message_of(layout)
    frame = data.draw(st.binary(min_size=layout.length, max_size=layout.length))
    raw, physical = decoded(message, frame, scaling=False), decoded(message, frame, scaling=True)
    for number, name in enumerate(layout.names):
        source = Source("M", name, Quantity.SPEED, (0,))
        reader = SignalReader(number, source, message)
        assert reader.position.raw(int.from_bytes(frame, reader.position.order)) == raw[name]
        got = Receiver(layout.database, [source]).read(Frame(0, CAN_ID, frame))
        if abs(physical[name]) <= Quantity.SPEED.limit:
            assert isinstance(got, list)
            assert [s.value for s in got] == [float(physical[name])]
        else:
            assert got is Reason.RANGE


@given(layouts(unit="N"), st.data())
def test_a_whole_message_is_decoded_as_by_cantools(layout: Layout, data: st.DataObject) -> None:
    """Byte orders mixed or not: every sample, or the frame as a whole is rejected."""
    message = message_of(layout)
    sources = [Source("M", name, Quantity.AXLE_LOAD, (k,)) for k, name in enumerate(layout.names)]
    if not sources:
        return
    receiver = Receiver(layout.database, sources)
    frame = data.draw(st.binary(min_size=layout.length, max_size=layout.length))
    physical = decoded(message, frame, scaling=True)
    got = receiver.read(Frame(0, CAN_ID, frame))
    if all(0 < physical[name] <= Quantity.AXLE_LOAD.limit for name in layout.names):
        assert isinstance(got, list)
        assert [(s.source, s.value) for s in got] == [(k, float(physical[n])) for k, n in enumerate(layout.names)]
    else:
        assert got is Reason.RANGE


@given(layouts(longest=32), st.data())
def test_a_written_frame_is_cantools_of_the_same_raw_values(layout: Layout, data: st.DataObject) -> None:
    message = message_of(layout)
    raw, values = dict.fromkeys(layout.names, 0), {}
    for signal in message.signals:
        if data.draw(st.booleans()):
            bits = signal.length - signal.is_signed
            drawn = data.draw(st.integers(-(1 << bits) if signal.is_signed else 0, (1 << bits) - 1))
            raw[signal.name] = drawn
            values[signal.name] = float(drawn * signal.scale + signal.offset)
    frame = Writer(message).frame(7, 0, values | {"NotThere": 1.0})
    assert frame == Frame(7, CAN_ID, message.encode(raw, scaling=False))


WRITTEN: st.SearchStrategy[Value] = (
    st.none() | st.floats(-1e12, 1e12) | st.sampled_from([math.nan, math.inf, "NoLabel"])
)


@given(layouts(mixed=False), st.data())
def test_any_values_are_written_as_by_cantools(layout: Layout, data: st.DataObject) -> None:
    """Those beyond a field, or not available, too."""
    message = message_of(layout)
    values = {name: data.draw(WRITTEN) for name in layout.names}
    plain, by_cantools = Writer(message), Writer(message)
    assert plain.order is not None or not layout.names
    by_cantools.order = None
    assert plain.frame(0, 0, values) == by_cantools.frame(0, 0, values)
