"""What is driven: a train on its rail, and what its driver asks for; from Python, or as TOML."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from sim_ecu.loop import scenario_keys as keys
from sim_ecu.physics.actuators import Actuators, Drive, Pneumatics
from sim_ecu.physics.cleaning import Cleaning
from sim_ecu.play import scenario as play
from sim_ecu.play import scenario_keys as play_keys
from sim_ecu.play.faults import read_fault
from sim_ecu.play.scenario import Course, Scenario, read_axles, read_wheelset
from wrcd.errors import InputError
from wrcd.settings import Section, read_toml, suggest

FOLDER = play.TO_DRIVE
# Nobody demands anything here but a controller.
NO_DRIVE = play.Drive("torque_N_m", Course((0.0,), (0.0,)), Course((0.0,), (1.0,)))


@dataclass(frozen=True, slots=True)
class DriveScenario:
    """A situation whose torques nobody has fixed.

    train: wheelsets, rail, track, sensors, faults and duration; its drives and held speed are not used. driver: share
    of the full effort over time, traction positive, braking negative. known_before: the rail of the demand was under
    the wheels before it came. stop_m_s: slower than that, the run is over. cleaning: None for a rail that stays as it
    is. speed_of_wrcd: what VehicleSpeed carries, "ground" or "wheels".
    """

    train: Scenario
    driver: Course
    actuators: Actuators = field(default_factory=Actuators)
    known_before: bool = False
    stop_m_s: float = 3.0
    cleaning: Cleaning | None = None
    speed_of_wrcd: str = keys.GROUND

    @property
    def axles(self) -> list[int]:
        """The axles' numbers."""
        return [a.number for a in self.train.axles]


def packaged_to_drive() -> list[str]:
    """Names of the scenarios to drive that come along."""
    return sorted(p.stem for p in FOLDER.glob("*.toml"))


def load_drive_scenario(name: str | Path) -> DriveScenario:
    """A packaged scenario to drive by its name, or a file by its path. Raises InputError."""
    path = path_of(name)
    return read_drive_scenario(read_toml(path), path.stem)


def path_of(name: str | Path) -> Path:
    """The file of a scenario to drive. Raises InputError for a name that is none."""
    path = FOLDER / f"{name}.toml"
    if path.exists():
        return path
    path = Path(name)
    if path.suffix != ".toml":
        known = packaged_to_drive()
        hint = suggest(str(name), known) or f"packaged: {', '.join(known)}; or give a path to a .toml file"
        if str(name) in play.packaged():
            hint = f"{name} is one to play: its torques are fixed; packaged: {', '.join(known)}"
        raise InputError(f"there is no scenario to drive {str(name)!r}", hint=hint)
    return path


def read_drive_scenario(top: Section, name: str) -> DriveScenario:
    """Check everything and build the scenario. Raises InputError."""
    for key in ("drive", "hold_speed"):
        if key in top:
            raise top.error(
                "is of a scenario to play", key, "the driver asks by [driver] demand, and what comes of it decides"
            )
    wheelset = read_wheelset(top.section("wheelset"))
    axles = read_axles(top, NO_DRIVE)
    if "driver" not in top:
        raise top.absent(keys.DRIVER.name, "write [driver] with demand = -1.0, or [[s, share], …]")
    driver = top.section(keys.DRIVER.name)
    if keys.DEMAND.name not in driver:
        raise driver.absent(keys.DEMAND.name, "it takes a share, or [[s, share], …]")
    demand = Course(*keys.DEMAND.read(driver))
    driver.done()
    speed = Course(*keys.SPEED.read(top))
    train = Scenario(
        name=name,
        title=play_keys.TITLE.read(top) or name,
        duration_s=play_keys.DURATION.of(top),
        speed=speed,
        hold_speed=False,
        wheelset=wheelset,
        axles=axles,
        faults=tuple(read_fault(f, [a.number for a in axles]) for f in top.sections("fault")),
    )
    out = DriveScenario(
        train=train,
        driver=demand,
        actuators=_actuators(top.section("actuators")),
        known_before=keys.KNOWN_BEFORE.read(top),
        stop_m_s=keys.STOP.of(top),
        cleaning=_cleaning(top),
        speed_of_wrcd=keys.SPEED_OF_WRCD.value(top),
    )
    top.done()
    return out


def _actuators(section: Section) -> Actuators:
    """[actuators]: what differs from the default ones."""
    drive = _table(section.section("drive"), keys.DRIVE_KEYS)
    pneumatics = _table(section.section("pneumatics"), keys.PNEUMATICS_KEYS)
    out = replace(
        Actuators(),
        drive=Drive(**drive),
        pneumatics=Pneumatics(**pneumatics),
        full_brake_N_m=keys.FULL_BRAKE.of(section),
    )
    section.done()
    return out


def _cleaning(top: Section) -> Cleaning | None:
    given = _table(top.section("cleaning"), keys.CLEANING_KEYS)
    return Cleaning(**given) if "cleaning" in top else None


def _table(section: Section, declared: tuple[play_keys.Measure, ...]) -> dict[str, float]:
    out = {key.name: key.of(section) for key in declared}
    section.done()
    return out
