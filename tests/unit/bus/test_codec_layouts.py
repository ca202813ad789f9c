"""Where signals lie, and what they say, against cantools: of any length, place, byte order, sign and coding."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.dbc import database
from tests.support.told_stages import packed
from wrcd.bus.dbc import Database, Message, find_message, parse_dbc
from wrcd.bus.frame import Frame
from wrcd.bus.mapping import MappedSignal
from wrcd.bus.positions import Numbers
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source
from wrcd.bus.units import Quantity
from wrcd.bus.writers import Writer
from wrcd.core.reading import Receiver

CAN_ID = 800
SCALES = ("1", "0.01", "2.5", "-0.5", "0.000001", "3")
OFFSETS = ("0", "-40", "12.5", "1000")
FD_LENGTHS = (12, 16, 20, 24, 32, 48, 64)
MAX_SIGNALS = 64
SMALL = 2.0**-80  # a factor with which any whole number is within its quantity's limit, and that rounds none


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
def layouts(draw: st.DrawFn, longest: int = 64, mixed: bool = True, unit: str = "m/s", odd: bool = False) -> Layout:
    """Signals one after another with gaps, in parts of whole bytes that are little or big endian. odd: CAN FD, and
    floating-point numbers, too."""
    length = draw(st.integers(1, 8) | st.sampled_from(FD_LENGTHS) if odd else st.integers(1, 8))
    cut = draw(st.integers(0, length)) if mixed else 0
    lines: list[str] = []
    names: list[str] = []
    floats: list[str] = []
    for first, end in ((0, cut), (cut, length)):
        little = draw(st.booleans())
        bit, bits = draw(st.integers(0, 7)), 8 * (end - first)
        while bit < bits and len(names) < MAX_SIGNALS:
            fitting = [n for n in (16, 32, 64) if n <= bits - bit] if odd and draw(st.booleans()) else []
            size = draw(st.sampled_from(fitting) if fitting else st.integers(1, min(bits - bit, longest)))
            start = 8 * first + bit if little else 8 * (first + bit // 8) + 7 - bit % 8
            names.append(f"S{len(names)}")
            if fitting:
                floats.append(f"SIG_VALTYPE_ {CAN_ID} {names[-1]} : {2 if size == 64 else 1};\n")
            sign = "-" if fitting else draw(st.sampled_from("+-"))
            scale, offset = draw(st.sampled_from(SCALES)), draw(st.sampled_from(OFFSETS))
            lines.append(f' SG_ {names[-1]} : {start}|{size}@{int(little)}{sign} ({scale},{offset}) [0|0] "{unit}" B\n')
            bit += size + draw(st.integers(0, 9))
    text = f'VERSION ""\nNS_ :\nBS_:\nBU_: B\nBO_ {CAN_ID} M: {length} B\n{"".join(lines + floats)}'
    return Layout(text, length, tuple(names))


def message_of(layout: Layout) -> Message:
    return find_message(layout.database, "M")


def decoded(message: Message, data: bytes, scaling: bool) -> dict[str, Any]:
    found = message.decode(data, decode_choices=False, scaling=scaling)
    assert isinstance(found, dict)
    return found


def frame_of(layout: Layout, data: bytes) -> Frame:
    return Frame(0, CAN_ID, data, fd=layout.length > 8)


def reason_of(value: float, quantity: Quantity, low: float = -math.inf) -> Reason | None:
    """Why a value is refused."""
    if not math.isfinite(value):
        return Reason.NOT_FINITE
    return None if abs(value) <= quantity.limit and value > low else Reason.RANGE


def values_of(got: Any) -> list[float]:
    assert isinstance(got, list)
    return [s.value for s in got]


@given(layouts(odd=True), st.data())
def test_every_signal_is_decoded_as_by_cantools(layout: Layout, data: st.DataObject) -> None:
    message = message_of(layout)
    content = data.draw(st.binary(min_size=layout.length, max_size=layout.length))
    raw, physical = decoded(message, content, scaling=False), decoded(message, content, scaling=True)
    for number, name in enumerate(layout.names):
        source = Source("M", name, Quantity.SPEED, (0,))
        found = MappedSignal(number, source, message).field.raw(Numbers(content))
        assert found == raw[name] or (math.isnan(found) and math.isnan(raw[name]))
        got = Receiver(layout.database, [source]).read(frame_of(layout, content))
        reason = reason_of(float(physical[name]), Quantity.SPEED)
        if reason is None:
            assert values_of(got) == [float(physical[name])]
        else:
            assert got is reason
        if abs(physical[name]) < 1e24:
            small = Source("M", name, Quantity.SPEED, (0,), factor=SMALL)
            (value,) = values_of(Receiver(layout.database, [small]).read(frame_of(layout, content)))
            assert math.isclose(value, float(physical[name]) * SMALL, rel_tol=1e-15)


@given(layouts(unit="N", odd=True), st.data())
def test_a_whole_message_is_decoded_as_by_cantools(layout: Layout, data: st.DataObject) -> None:
    """Byte orders mixed or not: every sample, or the frame as a whole is rejected."""
    message = message_of(layout)
    sources = [Source("M", name, Quantity.AXLE_LOAD, (k % 8,)) for k, name in enumerate(layout.names)]
    if not sources:
        return
    receiver = Receiver(layout.database, sources)
    content = data.draw(st.binary(min_size=layout.length, max_size=layout.length))
    physical = [float(decoded(message, content, scaling=True)[name]) for name in layout.names]
    got = receiver.read(frame_of(layout, content))
    refused = next(filter(None, (reason_of(x, Quantity.AXLE_LOAD, 0.0) for x in physical)), None)
    if refused is None:
        assert isinstance(got, list)
        assert [(s.source, s.value) for s in got] == list(enumerate(physical))
    else:
        assert got is refused


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


@pytest.mark.parametrize("sign", "+-")
@pytest.mark.parametrize("bits", [8, 32, 53, 54, 60, 63, 64])
def test_number_beyond_a_field_is_its_end(bits: int, sign: str) -> None:
    text = f'BO_ {CAN_ID} M: 8 B\n SG_ S : 0|{bits}@1{sign} (1,0) [0|0] "" B\n'
    by_cantools = Writer(find_message(database(text), "M"))
    for value in (1e300, -1e300, 2.0**64, 2.0**61, -(2.0**63), None):
        sent = packed(list(by_cantools.writers.values()), by_cantools.start, [value])
        assert sent == by_cantools.frame(0, 0, {"S": value}).data


@given(layouts(), st.data())
def test_any_numbers_are_sent_by_the_core_as_by_cantools(layout: Layout, data: st.DataObject) -> None:
    message = message_of(layout)
    numbers = st.none() | st.floats(-1e12, 1e12) | st.floats(-1e300, 1e300) | st.sampled_from([math.nan, math.inf])
    values = {name: data.draw(numbers) for name in layout.names}
    by_cantools = Writer(message)
    writers = list(by_cantools.writers.values())
    assert packed(writers, by_cantools.start, list(values.values())) == by_cantools.frame(0, 0, values).data
