"""Axles of a train on one track, and what a scenario says of them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.physics.axlebox import AxleBox
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.rail import CANT, CURVATURE, RailSection, rail_at, rail_table
from sim_ecu.physics.sensors import SENSOR_SETS, Sampling
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import QUALITY, SPECTRA, Spectrum, Track
from sim_ecu.physics.wheelset import YAW_RATE, FloatArray, Wheelset
from sim_ecu.play.player import Player, on_tracks
from sim_ecu.play.scenario import AxleScenario, Course, DriveCourse, Scenario, read_scenario
from wrcd.config.settings import parse_toml
from wrcd.errors import InputError

TICK_S = 0.005
BASIC = """
duration_s = 6
[[rail]]
curve = "A"
[drive]
utilisation = 0.2
"""


def scenario(text: str = "", axles: str = "[1, 2, 3, 4]", vehicle: str = "lone-wheelset") -> Scenario:
    """Of lone wheelsets: in a bogie axles move each other."""
    top = f'axles = {axles}\nvehicle = "{vehicle}"\n'
    return read_scenario(parse_toml(top + BASIC + text, "test.toml"), "test")


def felt(s: Scenario) -> FloatArray:
    """(yaw rate, lateral acceleration) of each sample and axle as measured, (t, axles, 2)."""
    return np.array([[(r.yaw_rate, r.lat_accel) for r in sample.readings] for sample in Player(s).measured()])


def alike(a: FloatArray, b: FloatArray) -> float:
    """Correlation of two signals."""
    return float(np.corrcoef(a, b)[0, 1])


def test_axles_of_a_scenario_run_on_one_track() -> None:
    """Bogies of 2.5 m, 19 m apart; the sensors' noise is each axle's own."""
    s = scenario()
    assert [a.position_m for a in s.axles] == [0.0, -2.5, -19.0, -21.5]
    assert len({id(a.track) for a in on_tracks(s.axles)}) == 1
    y = felt(s)[:, :, 1]
    for place, delay in ((1, 20), (2, 152), (3, 172)):
        assert alike(y[400 : 1200 - delay, 0], y[400 + delay :, place]) > 0.99
    # the same noise would correlate at no delay
    noise = np.diff(y, n=4, axis=0)
    assert abs(alike(noise[:, 0], noise[:, 1])) < 0.1


def test_an_axle_with_its_own_seed_runs_on_its_own_track() -> None:
    s = scenario("[axle.2]\nseed = 77", axles="[1, 2, 3]")
    assert [a.runs_on for a in s.axles] == [17, 77, 17]
    y = felt(s)[:, :, 1]
    assert abs(alike(y[400:1180, 0], y[420:, 1])) < 0.5
    assert alike(y[400:1048, 0], y[552:, 2]) > 0.99


def test_an_axle_alone_stands_at_the_trains_own_distance() -> None:
    assert [a.position_m for a in scenario(axles="[3]").axles] == [0.0]
    assert [a.position_m for a in scenario(axles="[3, 4]").axles] == [0.0, -2.5]
    assert [a.position_m for a in scenario("[axle.4]\nposition_m = -8", axles="[3, 4]").axles] == [0.0, -8.0]


def test_following_axles_do_not_change_the_first() -> None:
    alone, led = felt(scenario(axles="[1]")), felt(scenario(axles="[1, 4]"))
    assert led[:, 0] == pytest.approx(alone[:, 0], abs=2 * SENSOR_SETS["mems"].lat_accel.step)


def test_the_fifth_bogie_runs_as_the_others_do() -> None:
    """Its wheelsets are the ninth and tenth: beyond those that are integrated at once."""
    places = "".join(f"[axle.{k}]\nposition_m = {-10 * k}\n" for k in range(2, 6))
    largest = np.abs(felt(scenario(places, axles="[1, 2, 3, 4, 5]", vehicle="multiple-unit"))[:, :, 1]).max(axis=0)
    assert largest[4] < 10.0 * largest[:4].max()


def test_an_own_roughness_scales_the_same_irregularity() -> None:
    first, second = on_tracks(scenario('[axle.2]\ntrack = "poor"', axles="[1, 2]").axles)
    assert second.track.reach(300.0) == pytest.approx(
        first.track.reach(300.0) * math.sqrt(QUALITY["poor"] / QUALITY["good"]), rel=1e-6
    )


def test_axles_built_without_a_track_seed_have_tracks_of_their_own() -> None:
    rail = rail_table([(0.0, CURVES["A"], 0.0, 0.0)])
    drive = DriveCourse("utilisation", Course((0.0,), (0.2,)), Course((0.0,), (1.0,)))
    axles = [AxleScenario(n, rail, drive, SPECTRA["good"], SENSOR_SETS["mems"], n, 0.0) for n in (1, 2)]
    first, second = (a.track.reach(100.0) for a in on_tracks(axles))
    assert abs(alike(first[:, 1], second[:, 1])) < 0.3


def test_a_scenarios_track_is_a_named_spectrum_or_a_roughness() -> None:
    named, number = (scenario(f"[axle.1]\ntrack = {value}").axles[0].track for value in ('"erri-high"', "3e-7"))
    assert named == SPECTRA["erri-high"]
    assert number == Spectrum.of_roughness(3e-7)
    with pytest.raises(InputError, match="erri-higher"):
        scenario('[axle.1]\ntrack = "erri-higher"')


def test_an_axle_off_its_track_is_refused() -> None:
    rail = rail_table([RailSection(0.0, CURVES["A"])])
    with pytest.raises(ValueError, match="begins at"):
        Simulation(Wheelset(), [Axle(rail, Track(1e-7, 1), -2.5)], 25.0)


def test_coasting_is_without_torque() -> None:
    rail = rail_table([RailSection(0.0, CURVES["F"])])
    sim = Simulation(Wheelset(), [Axle(rail, Track(QUALITY["poor"], 3))], 25.0)
    out = sim.advance(command(400, utilisation=0.0, limit_of_peak=1.3), np.full(400, 25.0)).outputs
    assert not out[:, 0, 2].any()
    assert out[:, 0, YAW_RATE].std() > 1e-4


def test_the_axle_box_is_played() -> None:
    """Vibration is each axle's own; joints come to the second axle 2.5 m later."""
    box = "[axlebox]\nvibration_m_s2 = 0.3\njoint_m_s2 = 20\njoint_every_m = 30\n[axle.2.axlebox]\nvibration_m_s2 = 0"
    s = scenario(box, axles="[1, 2]")
    assert s.axles[0].axlebox == AxleBox(vibration_m_s2=0.3, joint_m_s2=20.0, joint_every_m=30.0)
    assert s.axles[1].axlebox == AxleBox(joint_m_s2=20.0, joint_every_m=30.0)
    calm = felt(scenario(axles="[1, 2]"))
    added = felt(s) - calm
    struck = [np.flatnonzero(np.abs(added[:, place, 1]) > 8.0) for place in (0, 1)]
    assert len(struck[0]) >= 4 * 5
    assert set(struck[0] + 20) - set(struck[1]) <= set(range(1200, 1220))
    # between the joints the second axle feels nothing and the first, 20 samples before, its vibration
    rest = np.abs(added[20:, 1, 1]) < 0.01
    assert rest.sum() > 900
    assert added[:-20, 0, 1][rest].std() == pytest.approx(0.3, rel=0.05)
    assert added[:-20, 0, 0][rest].std() == pytest.approx(0.3 * 0.002, rel=0.05)


def test_a_transition_is_read() -> None:
    text = '[[rail]]\nfrom_m = 100\ncurve = "A"\nradius_m = -800\ncant_rad = -0.04\ntransition_m = 80'
    rail = scenario(text).axles[0].rail
    assert rail_at(rail, 140.0)[[CURVATURE, CANT]] == pytest.approx([-0.5 / 800, -0.02])
    assert rail_at(rail, 180.0)[[CURVATURE, CANT]] == pytest.approx([-1 / 800, -0.04])


@pytest.mark.parametrize(
    ("text", "key", "hint"),
    [
        ("[axlebox]\nvibration = 1", "axlebox.vibration", "vibration_m_s2"),
        ("[axlebox]\nvibration_m_s2 = -1", "axlebox.vibration_m_s2", ""),
        ("[axlebox]\nband_hz = [50, 20]", "axlebox.band_hz", ""),
        ("[axlebox]\nband_hz = 20", "axlebox.band_hz", "[20, 100]"),
        ("[axlebox]\nband_hz = [100, 300]", "axlebox.band_hz", "left out"),
        (
            '[sensors]\nkind = "mems-8g"\n[axle.2]\nsensors = "mems"\n[axlebox]\nband_hz = [200, 900]',
            "axle.2.axlebox.band_hz",
            "",
        ),
        ("[sensors]\ncorner_hz = 50", "sensors.corner_hz", "mems-axle-box"),
        ('[sensors]\nkind = "mems-8g"\ninner_rate_hz = 1100', "sensors.inner_rate_hz", ""),
        ('[sensors]\nkind = "mems-8g"\ninner_rate_hz = 1000\ncorner_hz = 600', "sensors.corner_hz", ""),
        ('[axlebox]\njoint_shape = "bipolr"', "axlebox.joint_shape", "bipolar"),
        ("[axle.2.axlebox]\njoint_s = 0", "axle.2.axlebox.joint_s", ""),
        ("[axle.2]\nseed = -3", "axle.2.seed", ""),
        ('[[rail]]\nfrom_m = 9\ncurve = "A"\ntransition_m = 1e9', "rail[2].transition_m", ""),
        (
            '[[rail]]\nfrom_m = 9\ncurve = "A"\ntransition_m = 40\n[[rail]]\nfrom_m = 30\ncurve = "B"',
            "rail[3].from_m",
            "49 m",
        ),
    ],
)
def test_a_scenario_that_makes_no_sense_is_refused(text: str, key: str, hint: str) -> None:
    with pytest.raises(InputError) as e:
        scenario(text)
    assert e.value.key == key
    assert hint in (e.value.hint or "")
    assert e.value.line


def test_the_first_section_has_no_transition() -> None:
    with pytest.raises(InputError, match="transition_m: "):
        read_scenario(parse_toml('drive = { creep = 0 }\nrail = [{ curve = "A", transition_m = 9 }]', "x"), "x")


def test_sensors_that_sample_inside_are_read() -> None:
    text = (
        '[sensors]\nkind = "mems-axle-box"\ninner_rate_hz = 8000\ncorner_hz = 60\nfilter_order = 4\nrange_m_s2 = 19.6\n'
        'rectification = 1e-4\ngyro_rectification = 1e-7\nmounting = "bogie frame"\nlateral_lead_s = 0.004\n'
        "jitter_s = 0.001\ng_sensitivity = 1e-4\nmisalignment_rad = 0.03\nspeed_gain = 1.02\nfriction_share = 0.4\n"
        "friction_gain = 0.7\n[axlebox]\nvibration_m_s2 = 30\nband_hz = [20, 1000]\nvibration_power = 1.5\n"
        "corrugation_m_s2 = 20\ncorrugation_wavelength_m = 0.03\ncorrugation_m = [5, 90]\nflat_m_s2 = 99\n"
        "flat_every_m = 2.9\n"
    )
    axle = scenario(text, vehicle="multiple-unit").axles[0]
    kind = SENSOR_SETS["mems-axle-box"]
    assert axle.sensors == replace(
        kind,
        lat_accel=replace(kind.lat_accel, limit=19.6, step=2 * 19.6 / 65536),
        speed=replace(kind.speed, gain=1.02),
        sampling=Sampling(8000.0, 60.0, 4, 19.6, 1e-4, 1e-7),
        mounting="bogie frame",
        lateral_lead_s=0.004,
        jitter_s=0.001,
        g_sensitivity=1e-4,
        misalignment_rad=0.03,
        friction_share=0.4,
        friction_gain=0.7,
    )
    assert axle.axlebox == AxleBox(
        vibration_m_s2=30.0, band_hz=(20.0, 1000.0), vibration_power=1.5, corrugation_m_s2=20.0,
        corrugation_wavelength_m=0.03, corrugation_m=(5.0, 90.0), flat_m_s2=99.0, flat_every_m=2.9,
    )  # fmt: skip


def test_vibration_beyond_the_range_clips_when_played() -> None:
    """And the torque's friction part is missing where it is not read."""
    text = '[sensors]\nkind = "mems-axle-box"\nrange_m_s2 = 19.6\nfriction_share = 0.4\nfriction_gain = 0\n'
    shake = "[axlebox]\nvibration_m_s2 = 30\nband_hz = [20, 1000]\n"
    brakes = "[axle.1.drive]\nutilisation = -0.2\n"
    player = Player(scenario(brakes + text + shake, axles="[1, 2]"))
    samples = list(player.measured())
    known = list(Player(scenario(brakes, axles="[1, 2]")).measured())
    assert player.clipped == pytest.approx([len(samples) * 20 * math.erfc(19.6 / 30 / math.sqrt(2))] * 2, rel=0.05)
    share = [a.torque / b.torque for a, b in zip(samples[-1].readings, known[-1].readings, strict=True)]
    assert share == pytest.approx([0.6, 1.0], rel=0.02)
