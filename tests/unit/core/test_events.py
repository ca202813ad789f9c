"""Changes of Validity: each names the axle, the input, the figures and the limit, and nothing is made where nothing
changes."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.can_ids import LAT_ACCEL_A1, TORQUE_A2, YAW_RATE_A1
from tests.support.config_texts import AXLE
from tests.support.sensor_simulator import MS, SensorSimulator, beside
from tests.support.stepped import health_figures
from tests.support.told_stages import beginning, change_to, restarted
from wrcd.config.config import load_config, packaged
from wrcd.core import events
from wrcd.core.causes import RESERVED, Cause, Validity
from wrcd.core.core import Core
from wrcd.core.details import Details
from wrcd.core.events import COLUMNS, Change, csv_line
from wrcd.core.terms import EstimateDoubt

DEFAULT = load_config(None)


def texts(sim: SensorSimulator, since: int = 0) -> list[str]:
    """What has been said of axle 1 after so many changes."""
    return [c.text for c in sim.core.events.since(since) if c.axle == 1]


def own(tmp_path: Path, more: str, vehicle: str = "", form: str = "") -> SensorSimulator:
    """A train whose DBC may have a signal Slow of a form of its own in Torque_A2."""
    before = ""
    if form:
        text = DEFAULT.dbc_file.read_text(encoding="latin-1").replace("SG_ 290 Torque", "SG_ 290 Slow")
        begin = text.index(" SG_ Torque :", text.index("BO_ 290 "))
        text = f"{text[:begin]} SG_ Slow : {form} WRCD{text[text.index(chr(10), begin) :]}"
        (tmp_path / "own.dbc").write_text(text, encoding="latin-1")
        before = '[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "multiple-unit"\n'
    axle = AXLE.replace('torque = "Torque_A1.Torque"\n', more) if more.startswith("torque") else AXLE + more
    (tmp_path / "wrcd.toml").write_text(f'{before}[vehicle]\nspeed = "VehicleSpeed.Speed"\n{vehicle}{axle}')
    return SensorSimulator(load_config(tmp_path / "wrcd.toml"))


def run_with(sim: SensorSimulator, ms: int, raw: int) -> None:
    """Torque_A2 says so much beside axle 1's sensors."""
    sim.run(ms, lambda frames: beside(frames, YAW_RATE_A1, TORQUE_A2, raw))


def test_steady_run_says_nothing_and_makes_no_text(sim: SensorSimulator, monkeypatch: pytest.MonkeyPatch) -> None:
    sim.run(1500)
    assert texts(sim) == ["NotAvailable, WarmingUp: 0.02 s of the window's 1 s", "NotAvailable -> Valid"]
    total = sim.core.events.total

    def never(*_: object, **__: object) -> str:
        raise AssertionError("a text was made")

    monkeypatch.setattr(Details, "of", never)
    sim.run(3000)
    assert sim.core.events.total == total


def test_change_has_time_axle_and_both_validities(sim: SensorSimulator) -> None:
    sim.run(1500)
    total, begin_us = sim.core.events.total, sim.t
    sim.silent = {LAT_ACCEL_A1}
    sim.run(60)
    (change,) = sim.core.events.since(total)
    detail = "lateral acceleration LatAccel_A1.LatAccel 19.0 ms old, limit 15"
    assert change == Change(change.time_us, 1, Validity.VALID, Validity.DEGRADED, Cause.INPUT_STALE, detail)
    assert change.time_us % 20_000 == 0
    assert begin_us < change.time_us <= begin_us + 40 * MS
    seconds = f"{change.time_us // 1_000_000}.{change.time_us % 1_000_000:06d}"
    assert change.csv_line == f'{seconds},1,Valid,Degraded,InputStale,"{detail}"\n'


def test_refused_frames_are_named_by_reason_since_the_last_good_one(sim: SensorSimulator) -> None:
    sim.run(1500)
    total = sim.core.events.total
    for _ in range(40):
        for f in sim.frames():
            wrong = replace(f, data=f.data[:-1] if sim.counter % 2 else bytes(len(f.data)))
            sim.core.feed(wrong if f.can_id == YAW_RATE_A1 else f)
    stale, silent = texts(sim, total)
    assert stale.startswith("Valid -> Degraded, InputStale: yaw rate YawRate_A1.YawRate ")
    assert stale.endswith((" (refused since: 2 length, 1 crc)", " (refused since: 2 crc, 1 length)"))
    assert "Degraded -> NotAvailable, InputSilent: yaw rate YawRate_A1.YawRate 10" in silent
    total = sim.core.events.total
    sim.run(1500)
    sim.silent = {YAW_RATE_A1}  # what was refused before a good frame does not count
    sim.run(60)
    assert "refused" not in texts(sim, total)[-1]


def test_fault_of_a_single_frame_between_two_slots_is_described(sim: SensorSimulator) -> None:
    """At the slot it is over: what was noted when it came is said."""
    sim.run(1500)
    while sim.t % 20_000 != 5_000:
        sim.run(5)
    total = sim.core.events.total
    sim.yaw_status = 1
    sim.run(5)
    sim.yaw_status = 0
    sim.run(1500)
    assert texts(sim, total) == [
        "Valid -> Degraded, SensorDegraded: yaw rate YawRate_A1.YawRate: the status says Degraded",
        "Degraded -> Valid",
    ]


def speed_beyond(sim: SensorSimulator) -> None:
    while sim.speed < 60.4:
        sim.speed += 0.5
        sim.run(20)


def standstill(sim: SensorSimulator) -> None:
    while sim.speed > 2.9:
        sim.speed -= 0.2
        sim.run(20)


def clock_step(sim: SensorSimulator) -> None:
    sim.t += 100_000_000
    sim.during(200, silent={YAW_RATE_A1})


@pytest.mark.parametrize(
    ("what", "said"),
    [
        (speed_beyond, "SpeedOutOfRange: speed VehicleSpeed.Speed 60.50 m/s, design 3 to 60"),
        (
            lambda sim: sim.during(60, frozen=True),
            "Unchanged: yaw rate YawRate_A1.YawRate repeated 0.0006 rad/s in 7 consecutive frames",
        ),
        (lambda sim: sim.during(60, speed=40.0), "Restarted: speed VehicleSpeed.Speed jumped to 40.00 m/s"),
        (standstill, "Standstill: speed VehicleSpeed.Speed 2.80 m/s, limit 3"),
        (lambda sim: sim.during(60, spike=1_000_000), "Restarted: yaw rate YawRate_A1.YawRate jumped by 1."),
        (clock_step, "InputSilent: yaw rate YawRate_A1.YawRate has not come"),
    ],
    ids=lambda x: x.partition(":")[0] if isinstance(x, str) else "",
)
def test_cause_is_said_with_input_and_figures(
    sim: SensorSimulator, what: Callable[[SensorSimulator], object], said: str
) -> None:
    sim.run(1500)
    total = sim.core.events.total
    what(sim)
    assert said in "\n".join(texts(sim, total))


def test_sensor_whose_step_hides_its_noise_is_asked_about(tmp_path: Path) -> None:
    coarse = '{ signal = "YawRate_A1.YawRate", scale = 0.01 }'
    (tmp_path / "wrcd.toml").write_text(packaged(1).replace('"YawRate_A1.YawRate"', coarse))
    core = Core(load_config(tmp_path / "wrcd.toml"))
    begun = beginning(core, Cause.UNCHANGED, 0).copy()
    begun["listed"], begun["input"][0], begun["number"][:2] = 1, 0, (0.02, 6)
    said = details(core).of(change_to(core, Cause.UNCHANGED, None), begun)
    assert said == (
        "yaw rate YawRate_A1.YawRate repeated 0.02 rad/s in 7 consecutive frames "
        "(step 0.01, the design's noise 0.0003: too coarse?)"
    )


@pytest.mark.parametrize(
    ("more", "vehicle", "form", "raw", "said"),
    [
        ('axle_load = "Torque_A2.Slow"\n', "", '16|24@1- (1,0) [0|999999] "N"', 201_000,
         "LoadBeyond: axle load Torque_A2.Slow 201.0 kN, design 147.1 kN (0.7 to 1.3)"),
        ('wheel_radius = "Torque_A2.Slow"\n', "", '16|24@1- (0.1,0) [0|999] "mm"', 5_720,
         "RadiusBeyond: wheel radius Torque_A2.Slow 572 mm, design 500 mm (0.9 to 1.1)"),
        ('brake_torque = "Torque_A2.Torque"\n', "", "", 700_000,
         "TorquesContradict: torque Torque_A1.Torque -8.00 kN m against brake torque Torque_A2.Torque 7.00 kN m"),
        ("", "torque_is_total = false\n", "", 0,
         "FrictionShareUnknown: torque Torque_A1.Torque -8.00 kN m is no traction; brake torque (not mapped)"),
    ],
    ids=["load", "radius", "contradiction", "friction share"],
)  # fmt: skip
def test_cause_of_another_mapping_is_said_with_input_and_figures(
    tmp_path: Path, more: str, vehicle: str, form: str, raw: int, said: str
) -> None:
    sim = own(tmp_path, more, vehicle, form)
    sim.torque = -8_000.0
    run_with(sim, 1200, raw)
    assert f"NotAvailable -> Degraded, {said}" in texts(sim)


def test_part_of_a_torque_that_is_late_is_named(tmp_path: Path) -> None:
    sim = own(tmp_path, 'torque = ["Torque_A1.Torque", "Torque_A2.Torque"]\n')
    run_with(sim, 1200, 0)
    sim.run(60)
    assert texts(sim)[-1].startswith("Valid -> Degraded, InputStale: torque Torque_A2.Torque 3")
    assert texts(sim)[-1].endswith(" ms old, limit 30")


@pytest.mark.parametrize(("torques", "brakes", "listed"), [(1, 0, 1), (1, 1, 2), (3, 2, 5), (8, 1, 8), (10, 1, 8)])
def test_first_eight_torques_against_each_other_are_told(
    tmp_path: Path, torques: int, brakes: int, listed: int
) -> None:
    form = "WRCD\n SG_ ".join(f'{"" if k == 0 else f"S{k} : "}{16 + 2 * k}|2@1+ (1,0) [0|3] "Nm"' for k in range(11))
    names = [f'"Torque_A2.{"Slow" if k == 0 else f"S{k}"}"' for k in range(torques + brakes)]
    more = f"torque = [{', '.join(names[:torques])}]\n"
    more += f"brake_torque = [{', '.join(names[torques:])}]\n" if brakes else ""
    event = beginning(own(tmp_path, more, form=form).core, Cause.TORQUES_CONTRADICT, 0)
    assert event["listed"] == listed


def details(core: Core) -> Details:
    return Details(core.config, core.mapped)


def estimate(**values: float) -> dict[str, Any]:
    """An estimate: 20 % +- 2 over a second, all well, but for what is given."""
    usual = {
        "mu_available_pct": 20.0, "half_width_pp": 2.0, "used_pct": 10.0, "window_s": 1.0, "firing": 1.0,
        "live_share": 1.0, "mu_from_rules_pct": 20.0,
    }  # fmt: skip
    inputs = 0.5 * (DEFAULT.design.low + DEFAULT.design.high)
    inputs[0] += values.pop("beyond", 0.0) * (DEFAULT.design.high[0] - DEFAULT.design.low[0])
    return {**usual, **values, "inputs": inputs}


@pytest.mark.parametrize(
    ("cause", "values", "said"),
    [
        (Cause.NO_RULE, {"firing": 0.031}, "no rule matches well enough (0.031 of 0.05)"),
        (Cause.HARSH, {"live_share": 0.05}, "5 % of 1.00 s are far from pulses, limit 10 %"),
        (Cause.HARSH, {"live_share": 0.45}, "45 % of 1.00 s are far from pulses, too few"),
        (Cause.BEYOND_TRAINING, {"beyond": 2.0}, "residuals unlike the design's wheelset: no. 1 by 1.50 of its range"),
        (Cause.TOO_LITTLE_DATA, {"doubt": float(EstimateDoubt.GAPS), "live_share": 0.35},
         "35 % of 1.00 s hold consecutive measurements, limit 40 %"),
        (Cause.TOO_LITTLE_DATA, {"doubt": float(EstimateDoubt.GAPS), "live_share": 0.45},
         "45 % of 1.00 s hold consecutive measurements, too few"),
        (Cause.TOO_LITTLE_DATA, {"window_s": 0.2}, "0.20 s of track are less than 2.9 m"),
        (Cause.TOO_LITTLE_DATA, {"mu_available_pct": np.nan}, "1.00 s of measurements are no estimate"),
        (Cause.CONTRADICTION, {"used_pct": 12.3, "mu_from_rules_pct": 8.0},
         "torque Torque_A1.Torque: 12.30 % in use, the rules say 8.00 %"),
    ],
    ids=lambda x: x.label if isinstance(x, Cause) else "",
)  # fmt: skip
def test_doubt_of_an_estimate_is_said_with_the_figures_that_decided_it(
    cause: Cause, values: dict[str, float], said: str
) -> None:
    core = Core(DEFAULT)
    assert details(core).of(change_to(core, cause, estimate(**values)), None).startswith(said)


@pytest.mark.parametrize(
    ("times", "jump", "wait_s", "said"),
    [
        ((7.25, 3.0), 0.01, 0.0, "yaw rate YawRate_A1.YawRate off by 7.2 times the usual innovation, limit 4.5"),
        ((3.0, np.inf), 0.01, 2.0,
         "lateral acceleration LatAccel_A1.LatAccel off by infinite times the usual innovation, limit 12; waits 2 s"),
        ((7.25, np.nan), 0.01, 0.0,
         "yaw rate YawRate_A1.YawRate off by 7.2 times the usual innovation, limit 4.5; lateral acceleration "
         "LatAccel_A1.LatAccel off by infinite times the usual innovation, limit 12"),
        ((3.0, 11.9), -0.0801, 0.0, "yaw rate YawRate_A1.YawRate jumped by 0.080 rad/s, limit 0.08"),
        ((3.0, 3.0), np.nan, 0.0,
         "yaw rate YawRate_A1.YawRate or lateral acceleration LatAccel_A1.LatAccel stood out among its first samples"),
    ],
    ids=["innovation", "not finite, waits", "both", "a jump", "first samples"],
)  # fmt: skip
def test_restart_after_outliers_is_said_with_channel_and_limit(
    times: tuple[float, float], jump: float, wait_s: float, said: str
) -> None:
    core = Core(DEFAULT)
    known = restarted(core, times, jump, wait_s)
    assert details(core).of(change_to(core, Cause.RESTARTED, None), known) == said


def test_figures_of_a_pair_of_sensors_are_those_of_the_estimator(sim: SensorSimulator) -> None:
    sim.run(2500)
    told = change_to(sim.core, Cause.GYRO_DEAD, None)["number"][:7].tolist()
    found = health_figures(sim.core.estimator, 0)
    figures = (found.state, found.low, found.middle, found.yaw_rms, found.lat_rms, found.probability, found.sound)
    assert told == pytest.approx(figures, rel=1e-9)


OF_ESTIMATE = (
    Cause.TOO_LITTLE_DATA, Cause.NO_RULE, Cause.BEYOND_TRAINING, Cause.HARSH, Cause.CONTRADICTION
)  # fmt: skip


def test_every_cause_has_a_text_of_its_own(sim: SensorSimulator) -> None:
    """None is left to its words alone, whose figures are known."""
    core = sim.core
    sim.run(100)
    for cause in Cause:
        if cause in (Cause.NONE, Cause.RESTARTED, *RESERVED):
            continue
        begun = beginning(core, cause, sim.t)
        text = details(core).of(change_to(core, cause, estimate() if cause in OF_ESTIMATE else None), begun)
        assert text != cause.words


def test_long_text_is_cut(tmp_path: Path) -> None:
    names = {"YawRate_A1": f"Y{'a' * 100}w", "LatAccel_A1": f"L{'a' * 100}t"}
    dbc, axle = DEFAULT.dbc_file.read_text(encoding="latin-1"), AXLE
    for name, long in names.items():
        dbc, axle = dbc.replace(name, long), axle.replace(f"{name}.", f"{long}.")
    (tmp_path / "own.dbc").write_text(dbc, encoding="latin-1")
    text = '[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "multiple-unit"\n[vehicle]\nspeed = "VehicleSpeed.Speed"\n'
    (tmp_path / "wrcd.toml").write_text(text + axle)
    sim = SensorSimulator(load_config(tmp_path / "wrcd.toml"))
    sim.run(1500)
    sim.silent = {YAW_RATE_A1, LAT_ACCEL_A1}
    sim.run(1000)
    longest = max((c.detail for c in sim.core.events.since(0)), key=len)
    assert len(longest) == events.MAX_DETAIL
    assert longest.endswith(" ...")


def test_changes_are_kept_up_to_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "MAX_KEPT", 3)
    sim = SensorSimulator(DEFAULT)
    sim.run(1500)
    assert sim.core.events.total > 3
    kept = sim.core.events.since(0)
    assert len(kept) == 3
    assert sim.core.events.since(sim.core.events.total) == []
    assert sim.core.events.since(sim.core.events.total - 1) == kept[-1:]


def test_csv_line_quotes_what_has_a_comma() -> None:
    assert csv_line(COLUMNS) == "time_s,axle,from,to,cause,detail\n"
    assert csv_line(("1", 'a "b", c')) == '1,"a ""b"", c"\n'
