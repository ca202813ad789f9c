"""A vehicle's constants from its own log: found within their intervals, written, taken by design and scenarios; or
refused with a reason."""

import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import read_brief
from sim_ecu.design.calibrate.bogie_ticks import bogie_runs
from sim_ecu.design.calibrate.calibration import NEEDED, Calibration, calibrate
from sim_ecu.design.calibrate.calibration_words import sensors, to_record
from sim_ecu.design.calibrate.known_vehicle import KnownVehicle, read_known
from sim_ecu.physics.contact import curve_between
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.track import SPECTRA
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.play import play_to_log
from sim_ecu.play.scenario import Course, load_scenario
from sim_ecu.play.vehicles import load_vehicle, read_intervals, vehicle_path
from tests.support.ordinary_running import ordinary_running
from wrcd.config.config import load_config
from wrcd.config.settings import parse_toml, read_toml, read_whole
from wrcd.errors import InputError, Status
from wrcd.fit.stretches import BogieSignals

KNOWN = """[vehicle]
semi_wheelbase_m = 1.25
[wheelset]
r_0 = 0.5
M_v = 15000
"""
MINUTES, SPEEDS_M_S = 3.0, (20.0, 26.0, 15.0)


def another_unit() -> Wheelset:
    """Return a vehicle that is not what the fit begins with."""
    w = load_vehicle("multiple-unit")
    assert w.bogie is not None
    bogie = replace(w.bogie, primary_yaw_N_m_rad=8e6, secondary_yaw_damping_N_m_s_rad=1.2e6)
    return replace(w, name="another-unit", gamma=0.18, bogie=bogie)


def of(w: Wheelset, name: str) -> float:
    return float(getattr(w, name) if hasattr(w, name) else getattr(w.bogie, name))


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return three minutes of it, straight on at three speeds."""
    ride = ordinary_running(another_unit(), 5, MINUTES)
    rail = rail_table([RailSection(0.0, curve_between(0.35))])
    part_s = 60.0 * MINUTES / len(SPEEDS_M_S)
    times = [t for k in range(len(SPEEDS_M_S)) for t in (k * part_s + 5.0, (k + 1) * part_s)]
    speed = Course(tuple(times), tuple(np.repeat(SPEEDS_M_S, 2).tolist()))
    ride = replace(ride, speed=speed, axles=tuple(replace(a, rail=rail) for a in ride.axles))
    file = tmp_path_factory.mktemp("ride") / "ride.log"
    play_to_log(ride, file, truth=False)
    return file


@pytest.fixture(scope="module")
def signals(log: Path) -> BogieSignals:
    (run,) = bogie_runs(log, load_config(None), (0, 1))
    return run


@pytest.fixture(scope="module")
def known() -> KnownVehicle:
    return read_known(parse_toml(KNOWN, "known.toml"))


@pytest.fixture(scope="module")
def found(signals: BogieSignals, known: KnownVehicle) -> Calibration:
    return calibrate([signals], known)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "known.toml").write_text(KNOWN)
    return tmp_path


@pytest.mark.parametrize("name", NEEDED)
def test_constants_lie_in_their_intervals_and_are_nearer_than_the_guess(found: Calibration, name: str) -> None:
    true, guess = of(another_unit(), name), of(load_vehicle("multiple-unit"), name)
    low, high = found.intervals[name]
    assert low < true < high
    assert high / low < 1.8
    assert abs(np.log(of(found.wheelset, name) / true)) < abs(np.log(guess / true))


@pytest.mark.night
@pytest.mark.parametrize(
    ("seed", "track", "gamma", "suspension", "yaw_damper"),
    [(1, "fra-6", 1.0, 1.0, 1.0), (2, "erri-low", 0.6, 1.8, 0.5), (3, "china-hs", 1.5, 0.6, 2.0),
     (4, "erri-high", 1.2, 0.7, 6.0)],
)  # fmt: skip
def test_twenty_minutes_of_ordinary_running_tell_a_vehicle(
    folder: Path, seed: int, track: str, gamma: float, suspension: float, yaw_damper: float
) -> None:
    w = load_vehicle("multiple-unit")
    assert w.bogie is not None
    changed = {
        name: value * (yaw_damper if name.startswith("secondary_yaw_damping") else suspension)
        for name, value in asdict(w.bogie).items()
        if name.startswith(("primary", "secondary"))
    }
    w = replace(w, gamma=w.gamma * gamma, bogie=replace(w.bogie, **changed))
    play_to_log(ordinary_running(w, seed, 20.0, SPECTRA[track]), folder / "ride.log", truth=False)
    assert main(["calibrate", "ride.log", "--known", "known.toml", "-o", "mine.toml"]) == 0
    intervals = read_intervals(read_toml(folder / "mine.toml"))
    for name, most in NEEDED.items():
        low, high = intervals[name]
        assert low < of(w, name) < high, name
        assert np.log(high / low) < 2 * 1.5 * most, name


def test_load_and_wheelbase_stay_what_is_known(found: Calibration) -> None:
    w = found.wheelset
    assert w.bogie is not None
    assert w.bogie.carried_kg(w.m_w) == pytest.approx(15_000)
    assert w.bogie.semi_wheelbase_m == 1.25


def test_what_a_data_sheet_gives_of_a_suspension_is_known_and_shown(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = "[suspension]\nyaw_damper_N_s_m = 1e5\nyaw_damper_spacing_m = 2.6\n"
    known = read_known(parse_toml(KNOWN + parts, "known.toml"))
    assert of(known.wheelset, "secondary_yaw_damping_N_m_s_rad") == pytest.approx(2 * 1e5 * 1.3**2)
    assert known.sigma["secondary_yaw_damping_N_m_s_rad"] < 0.1
    (folder / "known.toml").write_text(KNOWN + parts)
    (folder / "empty.log").write_text("")
    assert main(["calibrate", "empty.log", "--known", "known.toml", "-o", "mine.toml"]) == Status.BAD_INPUT
    assert "secondary_yaw_damping_N_m_s_rad = 2 x 100000 x (2.6 / 2)^2 = 3.38e+05\n" in capsys.readouterr().out


def test_command_writes_a_vehicle_that_design_and_scenarios_take(
    log: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["calibrate", str(log), "--known", "known.toml", "-o", "mine.toml", "--html", "fit.html"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"\d+ stretches of 5.1 s used .* at 15 to 26 m/s", said)
    assert "known well enough" in said
    mine = read_brief(read_toml(vehicle_path(folder / "mine.toml"))).wheelset
    assert mine.name == "mine"
    assert set(NEEDED) < set(read_intervals(read_toml(folder / "mine.toml")))
    (folder / "mine-runs.toml").write_text(
        'vehicle = "mine.toml"\nrail = [{ curve = "A" }]\ndrive = { utilisation = 0.3 }\nduration_s = 1\n'
    )
    assert load_scenario(str(folder / "mine-runs.toml")).wheelset == mine
    (folder / "brief.toml").write_text('vehicle = "mine.toml"\n')
    assert read_brief(read_toml(folder / "brief.toml")).origin["stretches"] > 0
    text = (folder / "mine.toml").read_text()
    assert re.search(r'logs = \["ride.log sha256 [0-9a-f]{64}"\]\nstretches = \d+\n', text)
    page = (folder / "fit.html").read_text()
    assert "<svg" in page
    assert "<script" not in page
    assert "http://" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
        "http://creativecommons.org", ""
    )


def test_vehicle_file_with_a_word_too_much_is_refused() -> None:
    for text, key in (("[interval]\ngama = [1, 2]\n", "gama"), ("[origin]\nlog = 1\n", "log")):
        with pytest.raises(InputError, match=rf"{key}: unknown key"):
            read_brief(parse_toml(text, "mine.toml"))
    with pytest.raises(InputError, match=r"gamma: takes two numbers, the lower one first"):
        read_brief(parse_toml("[interval]\ngamma = [2, 1]\n", "mine.toml"))


def test_wrong_sensors_are_found(signals: BogieSignals, known: KnownVehicle) -> None:
    z = signals.z.copy()
    z[1:, 1] = z[:-1, 1]  # the leading accelerometer is read a tick before the gyro
    wrong = replace(signals, z=z, speed_m_s=0.97 * signals.speed_m_s)
    right, found = (calibrate([s], known) for s in (signals, wrong))
    said = "\n".join(sensors(found))
    assert re.search(r"leading axle: the accelerometer is read \d+\.\d ms before the gyro\n", said)
    assert re.search(r"the speed reads -\d\.\d %", said)
    assert found.fit is not None
    assert right.fit is not None
    more = {name: found.fit.logs[name] - right.fit.logs[name] for name in ("lead_1", "lead_2", "speed_scale")}
    assert more == pytest.approx({"lead_1": 0.005, "lead_2": 0.0, "speed_scale": -np.log(0.97)}, abs=0.0015, rel=0.2)


def test_clocks_of_the_axles_that_are_apart_are_found_and_do_no_harm(
    signals: BogieSignals, known: KnownVehicle
) -> None:
    z = signals.z.copy()
    z[2:, 2:] = z[:-2, 2:]
    found = calibrate([replace(signals, z=z)], known)
    late = next(line for line in sensors(found) if "clock" in line)
    assert float(re.findall(r"[+-]\d+\.\d", late)[0]) == pytest.approx(10.0, abs=2.0)
    low, high = found.intervals["gamma"]
    assert low < another_unit().gamma < high


def test_signals_of_two_bogies_are_refused_as_incoherent(signals: BogieSignals, known: KnownVehicle) -> None:
    n = round(125.0 / signals.tick_s)
    z = signals.z[:n].copy()
    z[:, 2:] = np.roll(z[:, 2:], 800, axis=0)
    found = calibrate([BogieSignals(signals.tick_s, z, signals.speed_m_s[:n], signals.ticked[:n])], known)
    assert "incoherent by" in found.refused


def test_too_short_a_log_is_refused_and_nothing_is_written(
    log: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = log.read_text().splitlines(keepends=True)
    (folder / "short.log").write_text("".join(lines[: len(lines) // 10]))
    assert main(["calibrate", "short.log", "--known", "known.toml", "-o", "mine.toml"]) == Status.STOPPED
    assert "too few calm stretches" in capsys.readouterr().err
    assert not (folder / "mine.toml").exists()


def test_what_is_not_known_well_enough_is_said_with_what_to_record(found: Calibration) -> None:
    few = replace(found, blocks=found.blocks)
    assert few.fit is not None
    few.fit.scores.fisher[:] /= 5  # as of a fifth of the stretches
    try:
        assert set(few.lacking) == set(NEEDED)
        assert re.search(
            r"for conicity, .* record until there are some \d+ minutes of calm stretches", "\n".join(to_record(few))
        )
    finally:
        few.fit.scores.fisher[:] *= 5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (KNOWN.replace("semi_wheelbase_m = 1.25", ""), "vehicle.semi_wheelbase_m: is missing"),
        (KNOWN.replace("r_0 = 0.5", ""), "wheelset.r_0: is missing"),
        (KNOWN.replace("M_v = 15000", ""), "wheelset.M_v: is missing"),
        (KNOWN.replace("M_v = 15000", "M_v = 2000"), "less than wheelset and frame weigh"),
        (KNOWN.replace("1.25", "1.25\nbody_mass_kg = 2e4"), "wheelset.M_v: and body_mass_kg are both there"),
        (KNOWN + "conicity = 0.1\n", "wheelset.conicity: unknown key"),
        ('vehicle = "metro"\n', "vehicle: is a lone wheelset"),
        (KNOWN.replace("r_0 = 0.5", "r_0 = 0.9"), "wheelset.r_0: is 0.9, of trains from 0.2 to 0.65"),
        (KNOWN.replace("15000", "141300"), "wheelset.M_v: is 141300, of trains from 1500 to 25000"),
        (KNOWN + "gamma = 0.5\n[interval]\ngamma = [0.1, 0.11]\n", "interval.gamma: does not hold the constant, 0.5"),
        (KNOWN + "[interval]\ngamma = [0.1, 0.2]\n", "interval.gamma: is of a constant that is not given"),
    ],
)
def test_known_file_that_does_not_do_is_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=re.escape(said)):
        read_known(parse_toml(text, "known.toml"))


def test_mistake_of_a_known_file_is_told_once(tmp_path: Path) -> None:
    (tmp_path / "known.toml").write_text(KNOWN.replace("15000", '"15000"'))
    with pytest.raises(InputError, match=r"M_v: takes a number, not '15000'$"):
        read_whole(tmp_path / "known.toml", lambda top, _: read_known(top))


def test_constant_that_is_known_is_a_prior_by_its_interval_or_within_a_tenth() -> None:
    text = KNOWN + "gamma = 0.1\nm_w = 1500\nk_s = 6e6\n"
    read = read_known(parse_toml(text, "known.toml"))
    assert (read.wheelset.gamma, read.wheelset.m_w) == (0.1, 1500)
    assert read.sigma == {"gamma": 0.06, "m_w": 0.06, "shaft": 0.06, "r_0": 0.02}
    found = read_known(parse_toml(text + "[interval]\ngamma = [0.05, 0.2]\n", "known.toml"))
    assert found.sigma == {"gamma": pytest.approx(np.log(4) / 3.29)}


def test_damper_that_a_packaged_vehicle_lacks_may_be_there_and_one_that_the_file_denies_is_not() -> None:
    name = "secondary_yaw_damping_N_m_s_rad"
    assert of(read_known(parse_toml('vehicle = "manchester-1"', "known.toml")).wheelset, name) > 0
    text = KNOWN.replace("1.25", f"1.25\n{name} = 0")
    assert of(read_known(parse_toml(text, "known.toml")).wheelset, name) == 0


def test_load_that_is_a_third_is_refused(signals: BogieSignals) -> None:
    text = KNOWN.replace("15000", "5000")
    found = calibrate([signals], read_known(parse_toml(text, "known.toml")))
    assert "look at load, wheel radius, wheelbase" in found.refused
    assert to_record(found) == []


def test_dead_signals_are_refused(signals: BogieSignals, known: KnownVehicle) -> None:
    z = signals.z.copy()
    z[:, 1] = 0.01
    assert calibrate([replace(signals, z=z)], known).refused


def test_log_with_a_day_between_its_parts_is_read_as_two_runs_and_a_short_piece_does_no_harm(
    log: Path, folder: Path, known: KnownVehicle
) -> None:
    lines = log.read_text().splitlines(keepends=True)
    day = [f"({float(x[1:18]) + 86400:.6f}{x[18:]}" for x in lines[20_000:40_000]]
    (folder / "two.log").write_text("".join(lines[:20_000] + day))
    runs = bogie_runs(folder / "two.log", load_config(None), (0, 1))
    assert len(runs) == 2
    assert sum(len(r.z) for r in runs) < 10_000
    short = [replace(runs[0], **{n: getattr(runs[0], n)[:k] for n in ("z", "speed_m_s", "ticked")}) for k in (1, 30)]
    assert calibrate([*short, *runs], known).refused.startswith("too few calm stretches")


def test_what_was_found_is_known_and_a_log_that_gives_nothing_is_left_out(
    log: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "nothing.log").write_text("(1700000000.000000) can0 7FF#00\n" * 40)
    args = ["calibrate", str(log), "nothing.log", "--known", "known.toml", "-o", "mine.toml"]
    assert main(args) == 0
    assert "warning: left out: nothing.log" in capsys.readouterr().err
    found = read_known(read_toml(folder / "mine.toml"))
    assert set(found.sigma) >= set(NEEDED)
    assert "secondary_yaw_N_m_rad" not in found.sigma
    assert main(["calibrate", str(log), str(log), "--known", "known.toml", "-o", "twice.toml"]) == Status.BAD_INPUT
    assert "is given twice" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--axles", "1,9"], "--axles: takes two axles of the configuration"),
        (["--axles", "1,x"], "--axles: takes two numbers"),
        (["--axles", "3,4"], "has no usable yaw rate of axle 3"),
        (["-o", "./known.toml"], "known.toml: -o: is read by this command; it would be lost"),
        (["--html", "known.toml"], "known.toml: --html: is read by this command; it would be lost"),
        (["--config", "one.toml"], "maps one axle"),
    ],
)
def test_command_that_cannot_be_is_refused(
    log: Path, folder: Path, more: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "one.toml").write_text(one_axle())
    argv = ["calibrate", str(log), "--known", "known.toml", "-o", "mine.toml", *more]
    assert main(argv) == Status.BAD_INPUT
    assert said in capsys.readouterr().err
    assert not (folder / "mine.toml").exists()


def one_axle() -> str:
    """Return the packaged configuration with its first axle alone."""
    from wrcd.config.config import DEFAULT

    head, *axles = re.split(r"(?m)^(?=\[\[axle\]\])", DEFAULT)
    return head + axles[0]
