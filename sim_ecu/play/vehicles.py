"""What runs on the rail: the packaged vehicles, and the tables [vehicle] and [wheelset] of a file.

`vehicle = "NAME"` is a packaged one. [wheelset] says what differs from its wheelset. [vehicle] says what differs from
the packaged multiple unit's bogie; M_v follows from it. [suspension] gives parts instead of constants of a bogie. Where
none is given the vehicle is the default one.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

from sim_ecu.physics.wheelset import Bogie, Wheelset
from sim_ecu.play import scenario_keys as keys
from sim_ecu.play.suspension import read_suspension
from wrcd.config.settings import Section, read_toml, read_whole, suggest
from wrcd.errors import InputError
from wrcd.resources import DEFAULT_DESIGN, LONE

FOLDER = Path(__file__).parent / "vehicles"
DEFAULT_VEHICLE = DEFAULT_DESIGN  # the default vehicle is that of the default design


def packaged_vehicles() -> list[str]:
    """Names of those that come along."""
    return sorted(p.stem for p in FOLDER.glob("*.toml"))


def vehicle_path(name: str | Path) -> Path:
    """A packaged vehicle's file by its name, or a file by its path. Raises InputError for a name that is none."""
    path = Path(name)
    if path.suffix == ".toml":
        return path
    known = packaged_vehicles()
    if str(name) not in known:
        hint = suggest(str(name), known) or f"{_packaged(known)}; or give a path to a .toml file"
        raise InputError(f"there is no vehicle {str(name)!r}", hint=hint)
    return FOLDER / f"{name}.toml"


def _packaged(known: list[str]) -> str:
    return f"packaged: {', '.join(known)}"


def vehicle_title(name: str) -> str:
    """One line about a packaged vehicle, for `sim-ecu list`."""
    return keys.TITLE.read(read_toml(vehicle_path(name))) or name


def load_vehicle(name: str) -> Wheelset:
    """A packaged vehicle's wheelset, with its bogie."""
    return read_whole(vehicle_path(name), lambda top, _: read_vehicle(top))


def read_vehicle(top: Section) -> Wheelset:
    """The vehicle of a file, from `vehicle`, [vehicle], [suspension] and [wheelset]. Raises InputError."""
    given = top.raw("vehicle")
    if isinstance(given, str) or given is None:
        named = DEFAULT_VEHICLE if given is None else given
        known = packaged_vehicles()
        if named not in known:
            raise top.error(f"there is no vehicle {named!r}", "vehicle", suggest(named, known) or _packaged(known))
        # the lone wheelset's own file names itself, and every other packaged one that or its [vehicle]
        base = Wheelset() if named == LONE else load_vehicle(named)
        bogie = base.bogie
    else:
        section = top.section("vehicle")
        base, bogie = Wheelset(), Bogie(**{key.name: key.of(section) for key in keys.VEHICLE_PARAMETERS})
        section.done()
    made = read_suspension(top)
    if made and bogie is None:
        raise top.error("a lone wheelset has none", "suspension", "name a vehicle with bogies")
    if bogie is not None:
        bogie = replace(bogie, **{name: of.value for name, of in made.items()})
    section = top.section("wheelset")
    if bogie is not None and "M_v" in section:
        hint = f'leave it out, change body_mass_kg, or write vehicle = "{LONE}"'
        raise section.error("follows from the masses of [vehicle]", "M_v", hint)
    numbers: dict[str, Any] = {key.name: key.of(section, getattr(base, key.name)) for key in keys.PARAMETERS}
    name = keys.NAME.read(section) if "name" in section else base.name
    section.done()
    if bogie is not None:
        numbers["M_v"] = bogie.carried_kg(numbers["m_w"])
    return replace(base, name=name or base.name, bogie=bogie, **numbers)
