"""Scenarios to drive: their keys, their parser, and what is driven.

No constant of the actuators is from a source: all are this project's own choice, of the size of a multiple unit's.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from sim_ecu.physics.actuators import Actuators, Drive, Pneumatics
from sim_ecu.physics.cleaning import Cleaning
from sim_ecu.play import scenario as play
from sim_ecu.play import scenario_keys as play_keys
from sim_ecu.play.scenario import Course, Scenario
from sim_ecu.play.scenario_keys import Measure, Other, Over
from wrcd.config.keys import Choice, Key
from wrcd.config.settings import Section, read_whole

GROUND, WHEELS = "ground", "wheels"

SPEED = Over("speed_m_s", "the speed at the start; it moves freely from then on", 0.0, 100.0, "m/s", 25.0)
DRIVER = Other("driver", "what the driver asks for", "needed")
ACTUATORS = Other("actuators", "drive and brakes of every wheelset, where they differ")
CLEANING = Other("cleaning", "the rail is cleaned by the energy of the slip; without the table it is not")
STOP = Measure("stop_m_s", "slower than that, the run is over", 0.0, 100.0, 3.0, unit="m/s")
SPEED_OF_WRCD = Choice(
    "speed_of_wrcd",
    "what VehicleSpeed carries. ground: the true speed, as of a radar; wheels: a reference made from the wheels, wrong "
    "where all of them slip",
    (GROUND, WHEELS),
    GROUND,
)

DEMAND = Over("demand", "share of the full effort: traction positive, braking negative", -1.0, 1.0)


FULL_BRAKE = Measure(
    "full_brake_N_m",
    "torque of the full service brake at the wheelset",
    0.0, 2e5, Actuators().full_brake_N_m, unit="N m",
)  # fmt: skip
OF_DRIVE = Other("drive", "traction motor and electric brake")
OF_PNEUMATICS = Other("pneumatics", "brake cylinder, its valve, its blocks or pads")

_OF_DRIVE: Mapping[str, tuple[str, float, float, str]] = {
    "max_traction_N_m": ("N m", 0.0, 2e5, "full traction"),
    "max_brake_N_m": ("N m", 0.0, 2e5, "full electric brake; 0: there is none"),
    "lag_s": ("s", 0.0, 10.0, "time constant from demand to torque"),
    "rise_N_m_s": ("N m/s", 1.0, 1e9, "how fast the torque's amount may grow"),
    "fall_N_m_s": ("N m/s", 1.0, 1e9, "how fast it may fall"),
    "fades_m_s": ("m/s", 0.0, 100.0, "below this speed the electric brake fades; at half of it there is none"),
    "max_power_kW": ("kW", 1.0, 1e5, "most power of traction at the wheel"),
    "cut_out_m_s": ("m/s", 1.0, 1000.0, "wheel speed above which there is no traction: the cut-out of overspeed"),
}
_OF_PNEUMATICS: Mapping[str, tuple[str, float, float, str]] = {
    "torque_per_bar_N_m": ("N m/bar", 1.0, 1e6, "friction torque at the wheelset"),
    "max_bar": ("bar", 0.0, 20.0, "highest pressure of the cylinder"),
    "valve_delay_s": ("s", 0.0, 1.0, "from the demand to the valve's act, in whole samples of 5 ms"),
    "fill_s": ("s", 0.0, 10.0, "time constant of filling"),
    "vent_s": ("s", 0.0, 10.0, "time constant of venting"),
}
DRIVE_KEYS = tuple(
    Measure(name, what, low, high, getattr(Drive(), name), unit=unit)
    for name, (unit, low, high, what) in _OF_DRIVE.items()
)
PNEUMATICS_KEYS = tuple(
    Measure(name, what, low, high, getattr(Pneumatics(), name), unit=unit)
    for name, (unit, low, high, what) in _OF_PNEUMATICS.items()
)

CLEANING_KEYS = (
    Measure(
        "energy_kJ_m",
        "energy per metre of track, both wheels, after which ln mu_0 has gone 63 % of its way to the clean rail's",
        0.01, 1e6, Cleaning().energy_kJ_m, unit="kJ/m",
    ),
    Measure(
        "clean_mu_0", "mu_0 of the rail when it is clean: that of the wet curve C", 0.005, 1.0,
        Cleaning().clean_mu_0,
    ),
)  # fmt: skip

# That an axle may have otherwise: all that one of a scenario to play may, but a drive of its own.
SHARED: tuple[Key, ...] = tuple(k for k in play_keys.SHARED if k is not play_keys.DRIVE)
# By the table's name. The others (rail, wheelset, sensors, axlebox, fault) are those of a scenario to play.
TABLES: Mapping[str, tuple[Key, ...]] = {
    "": (
        play_keys.TITLE, play_keys.DURATION, play_keys.AXLES, SPEED, *SHARED, *play_keys.VEHICLE_TABLES,
        play_keys.OF_AXLE, play_keys.FAULT, DRIVER, ACTUATORS, CLEANING, STOP, SPEED_OF_WRCD,
    ),
    "driver": (DEMAND,),
    "actuators": (FULL_BRAKE, OF_DRIVE, OF_PNEUMATICS),
    "actuators.drive": DRIVE_KEYS,
    "actuators.pneumatics": PNEUMATICS_KEYS,
    "cleaning": CLEANING_KEYS,
    "axle.N": (*SHARED, play_keys.POSITION),
}  # fmt: skip


# Nobody demands anything here but a controller.
NO_DRIVE = play.DriveCourse("torque_N_m", Course((0.0,), (0.0,)), Course((0.0,), (1.0,)))


@dataclass(frozen=True, slots=True)
class DriveScenario:
    """A situation whose torques nobody has fixed.

    train: wheelsets, rail, track, sensors, faults and duration; its drives and held speed are not used. driver: share
    of the full effort over time, traction positive, braking negative. stop_m_s: slower than that, the run is over.
    cleaning: None for a rail that stays as it is. speed_of_wrcd: what VehicleSpeed carries, "ground" or "wheels".
    """

    train: Scenario
    driver: Course
    actuators: Actuators = field(default_factory=Actuators)
    stop_m_s: float = 3.0
    cleaning: Cleaning | None = None
    speed_of_wrcd: str = GROUND

    @property
    def axles(self) -> list[int]:
        """The axles' numbers."""
        return [a.number for a in self.train.axles]


def load_drive_scenario(name: str | Path) -> DriveScenario:
    """A packaged scenario to drive by its name, or a file by its path. Raises InputError."""
    path = play.path_of(name, to_drive=True)
    return read_whole(path, read_drive_scenario)


def read_drive_scenario(top: Section, name: str) -> DriveScenario:
    """Check everything and build the scenario. Raises InputError."""
    for key in ("drive", "hold_speed"):
        if key in top:
            hint = "the driver asks by [driver] demand, and what comes of it decides"
            top.mistake(top.pop(key, "is of a scenario to play", hint))
    wheelset, axles = play.read_train(top, NO_DRIVE)
    demand = Course((0.0,), (0.0,))
    with top.collected():
        demand = _demand(top)
    speed = Course(*SPEED.read(top))
    train = Scenario(
        name=name,
        title=play_keys.TITLE.read(top) or name,
        duration_s=play_keys.DURATION.of(top),
        speed=speed,
        hold_speed=False,
        wheelset=wheelset,
        axles=axles,
        faults=play.read_faults(top, axles),
    )
    out = DriveScenario(
        train=train,
        driver=demand,
        actuators=_actuators(top.section("actuators")),
        stop_m_s=STOP.of(top),
        cleaning=_cleaning(top),
        speed_of_wrcd=SPEED_OF_WRCD.value(top),
    )
    top.done()
    return out


def _demand(top: Section) -> Course:
    if DRIVER.name not in top:
        raise top.absent(DRIVER.name, "write [driver] with demand = -1.0, or [[s, share], …]")
    driver = top.section(DRIVER.name)
    if DEMAND.name not in driver:
        raise driver.absent(DEMAND.name, "it takes a share, or [[s, share], …]")
    demand = Course(*DEMAND.read(driver))
    driver.done()
    return demand


def _actuators(section: Section) -> Actuators:
    """[actuators]: what differs from the default ones."""
    drive = _table(section.section("drive"), DRIVE_KEYS)
    pneumatics = _table(section.section("pneumatics"), PNEUMATICS_KEYS)
    out = replace(
        Actuators(),
        drive=Drive(**drive),
        pneumatics=Pneumatics(**pneumatics),
        full_brake_N_m=FULL_BRAKE.of(section),
    )
    section.done()
    return out


def _cleaning(top: Section) -> Cleaning | None:
    given = _table(top.section("cleaning"), CLEANING_KEYS)
    return Cleaning(**given) if "cleaning" in top else None


def _table(section: Section, declared: tuple[play_keys.Measure, ...]) -> dict[str, float]:
    out = _values(section, declared)
    section.done()
    return out


def _values(section: Section, declared: tuple[play_keys.Measure, ...]) -> dict[str, float]:
    return {key.name: key.of(section) for key in declared}
