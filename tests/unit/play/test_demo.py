"""`sim-ecu demo` in real time on python-can's virtual bus; its screen without one."""

import shlex
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import pytest

from sim_ecu.cli.main import main
from sim_ecu.play import demo
from sim_ecu.play.demo_screen import Screen
from sim_ecu.play.observer import ObservedTrace
from sim_ecu.play.pace import Pace
from sim_ecu.play.train import MessageValues
from tests.support.scenarios import held
from wrcd.cli.main import main as wrcd
from wrcd.config.config import load_packaged
from wrcd.core.causes import Cause, Validity
from wrcd.core.events import Change
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

THIRD_PARTY = Path(__file__).parents[2] / "data/dbc/third-party.toml"
FALL = """
duration_s = 4.0
speed_m_s = 25.0
rail = [{ curve = "A" }, { from_m = 62.5, curve = "F" }]
drive = { torque_N_m = [[0.0, 0.0], [1.0, 19000.0]] }
"""
FIRST_US = 1_700_000_000_000_000


def at(seconds: float) -> int:
    return FIRST_US + round(seconds * 1e6)


def test_the_demo_shows_the_estimate_and_leaves_log_picture_and_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fall.toml").write_text(FALL)
    assert main(["demo", "-i", "virtual", "-c", "test", "--scenario", "fall.toml", "-o", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr()
    values = shown.out
    lines = values.splitlines()
    legend, first = next(k for k, x in enumerate(lines) if "the truth" in x), next(
        k for k, x in enumerate(lines) if " s A1 |" in x
    )  # fmt: skip
    assert legend < first
    assert values.count(" s A1 |") >= 5
    assert any(x.endswith(" Valid") for x in lines)
    assert "axle 1: NotAvailable: " in values
    assert "axle 1: Valid" in values
    assert max(len(x) for x in lines if " s A1 |" in x) <= 80
    assert "log      out/fall.log" in values
    assert "picture  out/fall.png" in values
    assert "out/fall.html: " in values
    assert str(tmp_path) not in values
    assert "wrcd report" in (tmp_path / "out/fall.html").read_text()
    assert (tmp_path / "out/fall.log").read_text().count(" 091#") > 100
    assert (tmp_path / "out/fall.png").read_bytes().startswith(b"\x89PNG")
    warning = "wrcd: warning: out/fall.log: has no input frame of axles 2, 3, 4: NotAvailable throughout; not shown"
    assert set(shown.err.splitlines()) == {warning}
    assert "--replay" not in explained_hint(values, capsys)


def explained_hint(values: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The command that the demo hints at, which explains the largest fall."""
    hint = shlex.split(values.rpartition("Why did it fall? ")[2])
    assert hint[:2] == ["wrcd", "why"]
    assert wrcd(hint[1:]) == 0
    told = capsys.readouterr()
    assert told.out.splitlines()[0].startswith(f"Axle 1 at {float(hint[3]):.3f} s")
    assert "available adhesion fell from" in told.out
    assert "NotAvailable throughout; not shown" in told.err
    return hint


def test_computer_that_stands_still_costs_no_validity_without_a_kernel(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half of the time it does something else; the demo hurries in between, and its log is one in time."""
    moment = Screen.moment
    monkeypatch.setattr(demo, "_leave", lambda *_: None)

    def slow(self: Screen, traces: Mapping[int, ObservedTrace]) -> None:
        time.sleep(0.3)
        moment(self, traces)

    monkeypatch.setattr(Screen, "moment", slow)
    (tmp_path / "wet.toml").write_text(held("C", 3.0))
    assert main(["demo", "-i", "virtual", "-c", "slow", "--scenario", f"{tmp_path}/wet.toml", "-o", str(tmp_path)]) == 0
    values = capsys.readouterr().out
    told = [line for line in values.splitlines() if " s axle 1: " in line]
    assert told[-1].endswith("axle 1: Valid")
    assert not any("past its time-out" in line for line in told)
    assert "busy" not in values
    stamps = [frame.stamp_us for frame, _ in read_log(tmp_path / "wet.log", Damage())]
    assert stamps == sorted(stamps)
    assert 2_900_000 < stamps[-1] - stamps[0] < 3_100_000


def test_missing_extra_of_the_report_does_not_fail_the_demo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "bokeh"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "bokeh", None)
    (tmp_path / "wet.toml").write_text(held("C", 1.3))
    assert main(["demo", "-i", "virtual", "-c", "bare", "--scenario", f"{tmp_path}/wet.toml", "-o", str(tmp_path)]) == 0
    assert "report" in capsys.readouterr().err
    assert not (tmp_path / "wet.html").exists()


def test_paced_time_goes_on_in_small_steps_and_catches_up() -> None:
    class Computer:
        now_ns = 5_000_000_000

        def monotonic_ns(self) -> int:
            return self.now_ns

        def time_ns(self) -> int:
            return self.now_ns + 1_700_000_000_000_000_000

    real = Computer()
    pace = Pace(real)
    began_us = pace.wall_us()
    real.now_ns += 400_000_000
    pace.begin()
    pace.turn()
    assert pace.steady_us() == 0
    real.now_ns += 10_400_000
    steps = []
    for _ in range(12):
        before = pace.steady_us()
        pace.turn()
        steps.append(pace.steady_us() - before)
    assert steps == [1000] * 10 + [400, 0]
    assert pace.wall_us() - began_us == 10_400


def truth(available: float, used: float) -> dict[str, float]:
    return {"MuAvailable": available, "MuUsed": used}


def test_line_has_truth_estimate_and_use_in_their_places(capsys: pytest.CaptureFixture[str]) -> None:
    values: MessageValues = {"MuAvailable": 30.0, "Validity": "Valid", "Confidence": "Within5pp"}
    trace = ObservedTrace([(2.0, truth(40.0, 10.0))], [(2.0, values)])
    screen = Screen([1])
    screen.moment({1: trace})
    line = capsys.readouterr().out
    bar = line[line.index("|") + 1 : line.rindex("|")]
    assert (bar.count("="), bar.index("E"), bar.index("T")) == (5, 12, 16)
    assert "truth 40.0 %  wrcd  30.0 ± 5 %  Valid" in line
    trace.adhesion[0][1].update(MuAvailable=40.0, Confidence="None")
    screen.moment({1: trace})
    line = capsys.readouterr().out
    assert "*" in line
    assert "40.0 ± ? %" in line


def test_change_is_told_with_its_cause_of_the_axles_that_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    valid, degraded, cause = Validity.VALID, Validity.DEGRADED, Cause.TOO_LITTLE_DATA
    changes = [
        Change(at(3.0), 1, valid, degraded, cause, ""), Change(at(3.1), 2, valid, degraded, Cause.HARSH, ""),
        Change(at(3.5), 1, degraded, valid, Cause.NONE, ""),
    ]  # fmt: skip
    Screen([1]).changes(changes, FIRST_US * 1e-6)
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    assert " ".join(out.split()) == f"3.0 s axle 1: Degraded: {Cause.TOO_LITTLE_DATA.words} 3.5 s axle 1: Valid"


def test_hint_of_a_demo_with_an_own_dbc_replays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "_leave", lambda *_: None)
    (tmp_path / "fall.toml").write_text(FALL)
    words = ["demo", "-i", "virtual", "-c", "hint", "--scenario", str(tmp_path / "fall.toml"), "-o", str(tmp_path)]
    assert main([*words, "--config", str(THIRD_PARTY)]) == 0
    shown = capsys.readouterr()
    assert not shown.err
    assert "--replay" in explained_hint(shown.out, capsys)


def test_hint_is_at_the_end_of_the_largest_fall_and_not_before_its_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Frames of a loaded computer come up to a cycle late."""

    def hint(*percent: float | None) -> str:
        rows: list[tuple[float, MessageValues]] = [
            (2.5 + 0.02 * k + 0.0005, {} if p is None else {"Validity": "Valid", "MuAvailable": p})
            for k, p in enumerate(percent)
        ]
        demo._print_why(tmp_path / "x.log", {1: ObservedTrace([], rows)}, load_packaged(1), None)
        return capsys.readouterr().out

    assert " 2.641 --axle 1" in hint(30.0, 30.0, 30.0, 30.0, 30.0, 29.0, 28.0, 20.0, 20.0, 20.0, 21.0, 22.0)
    assert " 2.641 --axle 1" in hint(None, 30.0, 30.0, 30.0, 30.0, 30.0, 28.0, 20.0)
    assert hint(None, 30.0, None) == ""
    assert hint(*(20.0 + k for k in range(12))) == ""  # it only rises
    assert hint(30.0, 30.0, *[None] * 5, 10.0, 10.0) == ""  # it fell in a gap: what came between is not known
