"""What runs on the rail: the packaged vehicles, and the tables [vehicle] and [wheelset] of a file.

`vehicle = "NAME"` is a packaged one. [wheelset] says what differs from its wheelset. [vehicle] says what differs from
the packaged multiple unit's bogie; M_v follows from it. [suspension] gives parts instead of constants of a bogie. Where
none is given the vehicle is the default one. `vehicle = "FILE.toml"` is the vehicle of another file. One that
`sim-ecu calibrate` wrote says in [interval] how well each constant is known, and in [origin] from what.
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
    """The vehicle of a file, from `vehicle`, [vehicle], [suspension] and [wheelset]; [interval] and [origin] are
    checked. Raises InputError."""
    read_intervals(top)
    _own_origin(top)
    given = top.raw("vehicle")
    if isinstance(given, str) or given is None:
        base = _named(top, DEFAULT_VEHICLE if given is None else given)
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


def read_intervals(top: Section) -> dict[str, tuple[float, float]]:
    """[interval]: by name, between which values a constant lies with 90 %."""
    section = top.section("interval")
    found = {key.name: ends for key in keys.INTERVALS if (ends := key.read(section)) is not None}
    section.done()
    return found


def read_origin(top: Section) -> dict[str, Any]:
    """[origin], or that of the file that `vehicle` names: date, logs and stretches that constants were found from;
    empty where there is none."""
    given, vehicle = _own_origin(top), top.raw("vehicle")
    if given or not isinstance(vehicle, str) or not vehicle.endswith(".toml"):
        return given
    return _own_origin(read_toml(_beside(top, vehicle)))


def _own_origin(top: Section) -> dict[str, Any]:
    s = top.section("origin")
    found = {key.name: s.raw(key.name) if isinstance(key, keys.Other) else key.read(s) for key in keys.ORIGIN}
    if not isinstance(found["logs"], list | None):
        raise s.error("takes a list", "logs", "`sim-ecu calibrate` writes it")
    s.done()
    return {name: value for name, value in found.items() if value is not None}


def _beside(top: Section, name: str) -> Path:
    return Path(top.file).parent / name


def _named(top: Section, name: str) -> Wheelset:
    """The packaged vehicle of a name, or that of a file beside this one, which names no other file."""
    known = packaged_vehicles()
    if name.endswith(".toml"):
        path = _beside(top, name)
        if str(read_toml(path).raw("vehicle")).endswith(".toml"):
            raise top.error(f"{name} names another file", "vehicle", "name that one")
        return load_vehicle(str(path))
    if name not in known:
        hint = suggest(name, known) or f"{_packaged(known)}; or a .toml file"
        raise top.error(f"there is no vehicle {name!r}", "vehicle", hint)
    # the lone wheelset's own file names itself, and every other packaged one that or its [vehicle]
    return Wheelset() if name == LONE else load_vehicle(name)
