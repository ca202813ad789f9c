"""The whole chain over logs: rig, frames, daemon's core, adhesion; and the commands that people type."""

import csv
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from sim_ecu.play.encoder import databases
from sim_ecu.play.scenario import load_scenario, packaged
from tests.support.can_ids import id_of
from tests.support.lone_wheelset import LONE, PLAYED
from tests.support.scenarios import EIGHT_AXLES, SIX_AXLES, LogOf, held
from wrcd.cli.main import main as wrcd
from wrcd.config.config import packaged as packaged_axles
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

ROOT = Path(__file__).parents[3]
WANTED_CREEP_REACHED_S = 1.0


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as f:
        return list(csv.DictReader(f))


def truth(log: Path, axle: int = 1) -> dict[int, float]:
    """MuAvailable of the rig, by 20 ms slot."""
    _, database = databases()
    out: dict[int, float] = {}
    for frame, _ in read_log(log, Damage()):
        if frame.can_id == id_of(f"SimTruth_A{axle}"):
            values = database.decode_message(frame.can_id, frame.data)
            assert isinstance(values, dict)
            out[frame.stamp_us // 20_000] = float(str(values["MuAvailable"]))
    return out


@pytest.mark.parametrize("curve", "ABCEDF")
def test_estimate_at_the_peak_of_each_curve_is_within_a_point_or_a_tenth(
    log_of: LogOf, tmp_path: Path, curve: str
) -> None:
    log = log_of(PLAYED + held(curve))
    assert wrcd(["replay", str(log), "--design", LONE, "--csv", str(tmp_path / "a.csv")]) == 0
    true = truth(log)
    start = min(true) * 0.02
    from_s = start + WANTED_CREEP_REACHED_S + 1.0
    late = [r for r in rows(tmp_path / "a.csv") if r["axle"] == "1" and float(r["time_s"]) >= from_s]
    assert len(late) > 200
    for r in late:
        assert r["validity"] == "Valid"
        slot = round(float(r["time_s"]) * 50)
        expected = true.get(slot, true[slot - 1])
        assert abs(float(r["mu_available_pct"]) - expected) <= max(1.0, 0.1 * expected)
        assert abs(float(r["mu_used_pct"]) - expected) <= 0.1 * expected + 0.5


def test_six_axles_of_one_track_are_each_valid_on_their_own_rail(log_of: LogOf, tmp_path: Path) -> None:
    """All on one track, every axle on another curve, at its peak."""
    log = log_of(PLAYED + SIX_AXLES)
    six = ROOT / "examples" / "six-axles.toml"
    arguments = ["--design", LONE, "--config", str(six), "--csv", str(tmp_path / "a.csv")]
    assert wrcd(["replay", str(log), *arguments, "-o", str(tmp_path / "sent.log")]) == 0
    found = rows(tmp_path / "a.csv")
    for axle in range(1, 7):
        true = truth(log, axle)
        late = [r for r in found if r["axle"] == str(axle) and float(r["time_s"]) >= min(true) * 0.02 + 2.0]
        expected = sum(true.values()) / len(true)
        assert len(late) >= 195
        assert {r["validity"] for r in late} == {"Valid"}
        for r in late:
            assert abs(float(r["mu_available_pct"]) - expected) <= max(1.0, 0.1 * expected)
    sent = Counter(f.can_id for f, _ in read_log(tmp_path / "sent.log", Damage()))
    assert {i: n for i, n in sent.items() if i < 0x0A0} == {0x090 + a: 300 for a in range(1, 7)}


def test_eight_axles_on_one_rail_are_not_taken_for_each_other(log_of: LogOf, tmp_path: Path) -> None:
    """Wires that are swapped would show after ten seconds."""
    config = tmp_path / "eight.toml"
    config.write_text(packaged_axles(8))
    log = log_of(PLAYED + EIGHT_AXLES)
    arguments = ["--design", LONE, "--config", str(config), "--csv", str(tmp_path / "a.csv")]
    assert wrcd(["replay", str(log), *arguments]) == 0
    found = rows(tmp_path / "a.csv")
    valid = Counter(r["axle"] for r in found if r["validity"] == "Valid")
    assert set(valid) == {str(a) for a in range(1, 9)}
    assert min(valid.values()) > 450  # of 600, the first window and a smooth stretch aside
    assert not {"SensorsUnrelated", "TwoSenders"} & {r["cause"] for r in found}


def test_dump_command_decodes_a_log(log_of: LogOf, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dbc, log = str(ROOT / "dbc" / "sim_ecu.dbc"), log_of(held("A"))
    assert wrcd(["dump", str(log), "-n", "8", "--dbc", dbc]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 8
    assert lines[0].startswith("(1700000000.005000) can0 101#")
    assert " :: YawRate_A1(Crc: " in lines[0]
    assert lines[0].endswith(" rad/s)")
    truth = next(line for line in log.read_text().splitlines() if " 7A1#" in line)
    odd = tmp_path / "odd.log"
    frames = ("091#00", "091#FFFFFFFFFFFFFFFF", "20000040#00")
    odd.write_text("\n".join((truth, *(f"(1800000000.000000) can0 {f}" for f in frames), "")))
    assert wrcd(["dump", str(odd), "--dbc", dbc]) == 0
    for line, part in zip(
        capsys.readouterr().out.splitlines(),
        (" :: SimTruth_A1(", "cannot be decoded", "Adhesion_A1(", ":: error frame"),
        strict=True,
    ):
        assert part in line


@pytest.mark.parametrize("name", packaged())
def test_packaged_scenario_has_a_title_and_a_bounded_duration(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.title != name
    assert scenario.duration_s <= 120


BAD: dict[str, tuple[Sequence[str], str]] = {
    "replay of nothing": (["wrcd", "replay", "none.log"], "none.log: no such log"),
    "replay of rubbish": (["wrcd", "replay", "rubbish.log"], "rubbish.log: has not one readable frame"),
    "unknown configuration": (["wrcd", "check", "--config", "none.toml"], "none.toml: no such file"),
    "bad configuration": (["wrcd", "check", "--config", "bad.toml"], "bad.toml:10: limits.min_sped: unknown key"),
    "unknown scenario": (["sim-ecu", "play", "leafpatch", "--fast", "--log", "x.log"], "did you mean 'leaf-patch'?"),
    "fast without a log": (["sim-ecu", "play", "dry", "--fast"], "--fast needs --log"),
    "a log nobody writes": (["sim-ecu", "play", "dry", "--fast", "--log", "x.docx"], "x.docx: cannot be written"),
    "a scenario with a wrong key": (["sim-ecu", "play", "bad.toml", "--fast", "--log", "x.log"], "bad.toml:"),
    "no such folder for the table": (["wrcd", "replay", "one.log", "--csv", "none/x.csv"], "none/x.csv: cannot be"),
    "no such bus": (["wrcd", "run", "-i", "socketcan", "-c", "nowhere0"], "nowhere0"),
    "no such interface": (["wrcd", "run", "-i", "tincan", "-c", "x"], "'tincan' is no interface of python-can"),
    "rig without a bus": (["sim-ecu", "play", "dry", "-i", "socketcan", "-c", "nowhere0"], "nowhere0 cannot be opened"),
}


def test_closed_pipe_is_no_error(log_of: LogOf) -> None:
    first = subprocess.run(
        f"{sys.executable} -m wrcd.cli dump {log_of(held('A'))} | head -1",
        shell=True, capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    assert first.stdout.count("\n") == 1
    assert first.stderr == ""
