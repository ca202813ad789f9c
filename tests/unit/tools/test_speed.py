"""`wrcd check --speed`."""

import re
from pathlib import Path

import pytest

from wrcd import resources
from wrcd.bus.codec import Receiver
from wrcd.bus.reasons import Reason
from wrcd.config import load_config, packaged
from wrcd.tools import speed
from wrcd.tools.cli import main
from wrcd.tools.synthetic import Synthetic

# of the packaged DBC, and what another train may have instead
OWN_UNITS = (
    ('(1E-006,0) [-8.388607|8.388607] "rad/s"', '(0.0001,0) [-838.8607|838.8607] "deg/s"'),
    ('(0.0025,0) [0|163.8375] "m/s"', '(0.01,0) [0|655.35] "km/h"'),
)


@pytest.fixture(autouse=True)
def _one_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "BUDGET_S", 0.1)
    monkeypatch.setattr(speed, "MIN_BLOCKS", 1)


@pytest.fixture(params=[1, 4])
def axles(request: pytest.FixtureRequest) -> int:
    return int(request.param)


def test_every_axle_has_an_estimate_and_is_valid(axles: int, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(packaged(axles))
    found = speed.measure(load_config(tmp_path / "c.toml"))
    numbers = tuple(range(1, axles + 1))
    assert found.estimating == found.valid == numbers
    assert found.blocks >= 1
    assert 0 < found.tick_us <= found.largest_us
    assert found.share == pytest.approx(found.tick_us / 5000)


def test_frames_are_taken_by_the_receiver() -> None:
    config = load_config(None)
    receiver = Receiver(config.database, [i.source for i in config.inputs])
    ids = set()
    for tick in Synthetic(config).ticks(40):
        stamps = [f.stamp_us for f in tick]
        assert stamps == sorted(stamps)
        assert stamps[-1] // 5000 == stamps[0] // 5000
        for frame in tick:
            assert not isinstance(receiver.read(frame), Reason | None)
            ids.add(frame.can_id)
    assert ids == set(receiver.keys)


def test_trains_own_dbc_with_other_units_gives_estimates(tmp_path: Path) -> None:
    text = resources.DBC.read_text("cp1252")
    for old, new in OWN_UNITS:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "own.dbc").write_text(text, "cp1252")
    (tmp_path / "c.toml").write_text(f'dbc = {{ file = "own.dbc" }}\nwheelset = {{ name = "default" }}\n{packaged(2)}')
    assert speed.measure(load_config(tmp_path / "c.toml")).estimating == (1, 2)


def test_constant_speed_without_a_message_gives_estimates(tmp_path: Path) -> None:
    tables = packaged(1).partition("[[axle]]")[2]
    (tmp_path / "c.toml").write_text(f"[limits]\nconstant_speed_m_s = 20.0\n[[axle]]{tables}")
    assert speed.measure(load_config(tmp_path / "c.toml")).estimating == (1,)


def test_reference_is_linear_between_measured_axles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "REFERENCE_US", {1: 100.0, 4: 160.0})
    assert speed.reference_us(2) == pytest.approx(120.0)


def test_command_prints_tick_share_longest_tick_and_ratio(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--speed"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"\d+ µs a tick of 5 ms \(4 axles, median of \d+ blocks of 1 s\): \d+\.\d % of a core", out)
    assert re.search(r"\d+ µs a tick on a rough track", out)
    assert re.search(r"longest tick \d+\.\d\d ms", out)
    assert re.search(r"\d+\.\d\d times the reference, \d+ µs", out)
    assert "estimates      axles 1, 2, 3, 4; Valid: 1, 2, 3, 4" in out


def test_axle_without_an_estimate_is_named(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    found = speed.Speed(4, 0.005, 3, 100.0, 150.0, 200.0, (1, 2, 4), (1,))
    monkeypatch.setattr(speed, "measure", lambda *_, **__: found)
    assert speed.speed(load_config(None)) == 1
    assert "axles 1, 2, 4; Valid: 1; the others cost less" in capsys.readouterr().out
