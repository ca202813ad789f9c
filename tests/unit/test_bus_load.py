"""Which bus carries how many axles."""

import re
from pathlib import Path

import pytest

from tests.support.bus_load import MAX_LOAD_PCT, bits, bits_per_s, of_axles
from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.core.configuration import MAX_AXLES

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "bus-load.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("payload", "shortest", "longest"), [(0, 47, 55), (4, 79, 95), (5, 87, 105), (8, 111, 135)])
def test_frame_has_47_bits_besides_its_bytes_and_stuff_bits(payload: int, shortest: int, longest: int) -> None:
    assert (bits(payload, stuffed=False), bits(payload, stuffed=True)) == (shortest, longest)


def test_page_names_the_most_axles_of_each_bit_rate() -> None:
    production = load_dbc(resources.DBC)
    named = re.findall(r"^\| (\d+) ([kM])bit/s \| (\d) \|$", PAGE, re.MULTILINE)
    assert len(named) == 3
    for number, unit, axles in named:
        rate = int(number) * {"k": 1_000, "M": 1_000_000}[unit]
        load = [100 * bits_per_s(of_axles(production, None, a), True) / rate for a in range(1, MAX_AXLES + 1)]
        assert int(axles) == sum(x <= MAX_LOAD_PCT for x in load)
