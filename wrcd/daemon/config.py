"""The configuration: a TOML file that says which signals carry what, or the default, which is the packaged DBC."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from wrcd import resources
from wrcd.bus.codec import Source, Writer
from wrcd.bus.dbc import (
    Database,
    check_encodable,
    check_plain,
    cycle_ms,
    data_id,
    find_message,
    find_signal,
    load_dbc,
    timeout_ms,
)
from wrcd.bus.units import Quantity, factor
from wrcd.daemon.report import sendable
from wrcd.errors import InputError
from wrcd.estimator.design import Design, load_design
from wrcd.settings import Section, parse_toml, read_toml, suggest

T = TypeVar("T")
MOST_AXLES = 4
AXLE_QUANTITIES = (
    Quantity.YAW_RATE,
    Quantity.LAT_ACCEL,
    Quantity.TORQUE,
    Quantity.BRAKE_TORQUE,
    Quantity.AXLE_LOAD,
    Quantity.WHEEL_RADIUS,
)
VEHICLE_QUANTITIES = (Quantity.SPEED, Quantity.DIRECTION)
NEEDED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE)
DEFAULT_TIMEOUT_MS = 100
ADHESION_NEEDS = ("Validity", "MuAvailable")


@dataclass(frozen=True, slots=True)
class AxleConfig:
    """One wheelset: its number (1 … 4) and the messages that tell about it."""

    number: int
    adhesion: str
    detail: str | None
    inputs: str | None


@dataclass(frozen=True, slots=True)
class Input:
    """A mapped signal and after how long without it it is stale."""

    source: Source
    timeout_us: int


@dataclass(frozen=True, slots=True)
class RecorderConfig:
    """The flight recorder: seconds of frames in memory (0: none), and how much its folder (None: none) may hold."""

    folder: Path | None
    seconds: float
    most_files: int  # dumps; each is a log and a state
    most_mb: float

    @property
    def on(self) -> bool:
        """Whether there is anything to record for."""
        return self.folder is not None and self.seconds > 0


@dataclass(frozen=True, slots=True)
class Config:
    """All that the daemon runs with."""

    file: str
    interface: str
    channel: str
    hardware_stamps: bool
    dbc_file: Path
    database: Database
    design_file: Path
    design: Design
    axles: tuple[AxleConfig, ...]
    inputs: tuple[Input, ...]
    status: str | None
    rejects: str | None
    link: str | None
    not_available_after_us: int
    min_speed_m_s: float
    constant_speed_m_s: float | None
    torque_is_total: bool
    adhesion_cycle_us: int
    detail_cycle_us: int
    status_cycle_us: int
    recorder: RecorderConfig


DEFAULT = """
[vehicle]
speed = "VehicleSpeed.Speed"
""" + "".join(
    f"""
[[axle]]
number = {a}
yaw_rate = "YawRate_A{a}.YawRate"
lateral_acceleration = "LatAccel_A{a}.LatAccel"
torque = "Torque_A{a}.Torque"
"""
    for a in range(1, MOST_AXLES + 1)
)


def load_config(
    path: Path | None,
    read_dbc: Callable[[Path], Database] = load_dbc,
    read_design: Callable[[Path], Design] = load_design,
) -> Config:
    """Read a configuration file, or the default one for None. Raises InputError with file, line, key and advice.

    Who has the DBC or the design already says so by a reader of their own.
    """
    if path is None:
        return _config(parse_toml(DEFAULT, "default configuration"), Path(), read_dbc, read_design)
    return _config(read_toml(path), path.parent, read_dbc, read_design)


def _config(
    top: Section, folder: Path, read_dbc: Callable[[Path], Database], read_design: Callable[[Path], Design]
) -> Config:
    bus, dbc, estimator = top.section("bus"), top.section("dbc"), top.section("estimator")
    limits, vehicle = top.section("limits"), top.section("vehicle")
    interface, channel = bus.get("interface", str, "socketcan"), bus.get("channel", str, "can0")
    dbc_file = _path(dbc, "file", folder, resources.DBC)
    database = _load(dbc, "file", dbc_file, read_dbc)
    design_file = _path(estimator, "design", folder, resources.DESIGN)
    design = _load(estimator, "design", design_file, read_design)
    _same_wheelset(top.section("wheelset"), design, design_file)
    axles, inputs, numbers = [], [], set()
    sent: set[str] = set()
    tables = list(top.sections("axle"))
    if not 1 <= len(tables) <= MOST_AXLES:
        raise top.error(
            f"takes 1 to {MOST_AXLES} tables, found {len(tables)}", "axle", "write [[axle]] for each wheelset"
        )
    for place, table in enumerate(tables):
        axle = _axle(table, database)
        if axle.number in numbers:
            raise table.error(f"{axle.number} is there twice", "number")
        numbers.add(axle.number)
        for key, name in (("adhesion", axle.adhesion), ("detail", axle.detail), ("inputs", axle.inputs)):
            if name in sent:
                raise table.error(f"{name} is sent for another axle already", key)
            if name:
                sent.add(name)
        axles.append(axle)
        inputs += _inputs(table, database, AXLE_QUANTITIES, (place,))
        table.done()
    inputs += _inputs(vehicle, database, VEHICLE_QUANTITIES, tuple(range(len(axles))))
    dead_after_us = round(1000 * limits.number("not_available_after_ms", 100.0, 5.0, 10_000.0))
    for i in inputs:
        if i.source.quantity in (*NEEDED, Quantity.SPEED) and i.timeout_us > dead_after_us:
            raise limits.error(
                f"{dead_after_us / 1000:g} ms is less than the time-out of {i.source.message}.{i.source.signal}, "
                f"{i.timeout_us / 1000:g} ms",
                "not_available_after_ms",
                "give a longer one: an input that is silent for so long ends the estimate",
            )
    constant = limits.maybe("constant_speed_m_s", float)
    if constant is not None:
        limits.number("constant_speed_m_s", constant, 0.0, Quantity.SPEED.limit)
    if constant is None and Quantity.SPEED not in {i.source.quantity for i in inputs}:
        raise vehicle.error(
            "is missing", "speed", 'name the signal ("Message.Signal") or give limits.constant_speed_m_s'
        )
    status = _optional(vehicle, "status_message", database, "WrcdStatus")
    config = Config(
        file=str(top.file),
        interface=interface,
        channel=channel,
        hardware_stamps=bus.choice("timestamps", ("kernel", "hardware"), "kernel") == "hardware",
        dbc_file=dbc_file,
        database=database,
        design_file=design_file,
        design=design,
        axles=tuple(axles),
        inputs=tuple(inputs),
        status=status,
        rejects=_optional(vehicle, "rejects_message", database, "WrcdRejects"),
        link=_optional(vehicle, "link_message", database, "WrcdLink"),
        not_available_after_us=dead_after_us,
        min_speed_m_s=limits.number("min_speed_m_s", 3.0, 0.1, 60.0),
        constant_speed_m_s=constant,
        torque_is_total=vehicle.get("torque_is_total", bool, True),
        adhesion_cycle_us=_cycle(database, axles[0].adhesion, 20),
        detail_cycle_us=_cycle(database, axles[0].detail, 100),
        status_cycle_us=_cycle(database, status, 1000),
        recorder=_recorder(top.section("recorder"), folder),
    )
    for section in (bus, dbc, estimator, limits, vehicle, top):
        section.done()
    return config


def _recorder(section: Section, folder: Path) -> RecorderConfig:
    # where systemd says that a service may keep things; it may name several, by colons
    given = section.maybe("folder", str) or os.environ.get("STATE_DIRECTORY", "").partition(":")[0]
    most_files = section.get("most_files", int, 20)
    if not 1 <= most_files <= 10_000:
        raise section.error(f"takes 1 … 10000, not {most_files}", "most_files")
    config = RecorderConfig(
        folder=folder / given if given else None,
        seconds=section.number("seconds", 60.0, 0.0, 600.0),
        most_files=most_files,
        most_mb=section.number("most_mb", 200.0, 1.0, 1e6),
    )
    section.done()
    return config


def _path(section: Section, key: str, folder: Path, default: Path) -> Path:
    given = section.maybe(key, str)
    return default if given is None else folder / given


def _load(section: Section, key: str, path: Path, load: Callable[[Path], T]) -> T:
    """Load a file that the configuration names: the error says both where it is named and what is wrong with it."""
    try:
        return load(path)
    except InputError as e:
        if key in section:
            raise section.error(str(e), key) from None
        raise


def _axle(table: Section, database: Database) -> AxleConfig:
    number = table.take("number", int)
    if not 1 <= number <= MOST_AXLES:
        raise table.error(f"takes 1 … {MOST_AXLES}, not {number}", "number")
    adhesion = table.get("adhesion", str, f"Adhesion_A{number}")
    _writer(table, "adhesion", database, adhesion, ADHESION_NEEDS)
    return AxleConfig(
        number,
        adhesion,
        detail=_optional(table, "detail", database, f"AdhesionDetail_A{number}"),
        inputs=_optional(table, "inputs", database, f"InputHealth_A{number}"),
    )


def _optional(section: Section, key: str, database: Database, usual: str) -> str | None:
    """A message to send that may be left out: named, or the usual one where the DBC has it."""
    name = section.maybe(key, str)
    if name is None and any(m.name == usual for m in database.messages):
        name = usual
    if name is not None:
        _writer(section, key, database, name, ())
    return name


def _inputs(
    section: Section, database: Database, quantities: tuple[Quantity, ...], axles: tuple[int, ...]
) -> list[Input]:
    out = []
    for q in quantities:
        named = section.maybe(q.key, str)
        if named is None:
            if q in NEEDED:
                raise section.error("is missing", q.key, 'name the signal that carries it: "Message.Signal"')
            continue
        message_name, dot, signal_name = named.partition(".")
        if not dot:
            raise section.error(f"{named!r} is not of the form Message.Signal", q.key)
        try:
            message = find_message(database, message_name)
            signal = find_signal(message, signal_name)
            factor(signal.unit, q)
            data_id(message)
            timeout = timeout_ms(message, signal) or DEFAULT_TIMEOUT_MS
            check_plain(message)
        except KeyError as e:
            raise section.error(str(e.args[0]), q.key, _nearest(database, message_name, signal_name)) from None
        except ValueError as e:
            raise section.error(str(e), q.key, "map a signal with another unit, or mend the DBC") from None
        out.append(Input(Source(message_name, signal_name, q, axles), timeout * 1000))
    return out


def _nearest(database: Database, message: str, signal: str) -> str:
    every = {f"{m.name}.{s.name}" for m in database.messages for s in m.signals}
    return suggest(f"{message}.{signal}", every)


def _writer(section: Section, key: str, database: Database, name: str, needs: tuple[str, ...]) -> None:
    try:
        message = find_message(database, name)
        Writer(message, needs)
        sendable(message)
        cycle_ms(message)
        check_encodable(message)
    except KeyError as e:
        hint = suggest(name, [m.name for m in database.messages]) or f'give [[axle]] {key} = "…"'
        raise section.error(str(e.args[0]), key, hint) from None
    except ValueError as e:
        raise section.error(str(e), key) from None


def _cycle(database: Database, name: str | None, default_ms: int) -> int:
    if name is None:
        return default_ms * 1000
    return (cycle_ms(find_message(database, name)) or default_ms) * 1000


def _same_wheelset(section: Section, design: Design, file: Path) -> None:
    """[wheelset] in the configuration states what the train has; a design for another one is refused."""
    for key in section:
        if key not in design.wheelset:
            raise section.error(
                "unknown key", key, suggest(key, design.wheelset) or "the keys of the design's wheelset"
            )
        stated = section.raw(key)
        has = design.wheelset[key]
        same = abs(stated - has) <= 1e-6 * abs(has) if _both_numbers(stated, has) else stated == has
        if not same:
            raise section.error(
                f"is {stated!r}, but the design file {file} is for a wheelset with {has!r}",
                key,
                "make a design for this wheelset with `sim-ecu design`",
            )


def _both_numbers(a: object, b: object) -> bool:
    return all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (a, b))
