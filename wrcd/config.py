"""The configuration: a TOML file that says which signals carry what, or the default, which is the packaged DBC."""

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from wrcd import resources
from wrcd.bus.dbc import Database, data_id, find_message, load_dbc
from wrcd.bus.units import Quantity
from wrcd.core.configuration import MAX_AXLES, AxleConfig, Config, Input, RecorderConfig
from wrcd.errors import InputError
from wrcd.estimator.design import Design, load_design
from wrcd.mapping import (
    AXLE_QUANTITIES,
    NEEDED,
    STATUS_MESSAGES,
    STATUS_MS,
    VEHICLE_QUANTITIES,
    axle,
    inputs,
    optional,
    usual_messages,
)
from wrcd.settings import Section, parse_toml, read_toml, suggest

T = TypeVar("T")
STALE_TICKS = 3  # of gyro and accelerometer: two may be missing
DEFAULT_AXLES = 4


def packaged(axles: int) -> str:
    """The TOML text that maps the packaged DBC's first axles."""
    return """
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
        for a in range(1, axles + 1)
    )


DEFAULT = packaged(DEFAULT_AXLES)


def load_config(
    path: Path | None,
    read_dbc: Callable[[Path], Database] = load_dbc,
    read_design: Callable[[Path], Design] = load_design,
) -> Config:
    """Read a configuration file, or the default one for None. Raises InputError with file, line, key and advice.

    Who has the DBC or the design already says so by a reader of their own.
    """
    return _config(*_source(path), read_dbc, read_design)


def load_config_to_run(path: Path | None) -> Config:
    """The same for the daemon, sooner: attributes and comments of messages that the configuration cannot mean are not
    parsed."""
    top, folder = _source(path)
    return _config(top, folder, partial(load_dbc, names=_messages(top)), load_design)


def load_packaged(axles: int) -> Config:
    """The default configuration, but of so many axles."""
    return _config(parse_toml(packaged(axles), "default configuration"), Path(), load_dbc, load_design)


def _messages(top: Section) -> set[str]:
    """Names of all messages that a configuration can mean: what it names, and what is sent without being named."""
    named = {text.partition(".")[0] for text in top.strings()}
    numbers = (table.raw("number") for table in top.sections("axle"))
    usual = {name for n in numbers if isinstance(n, int) for name in usual_messages(n)}
    return named | usual | set(STATUS_MESSAGES)


def _source(path: Path | None) -> tuple[Section, Path]:
    """The configuration's top level, and the folder from which its paths go."""
    return (parse_toml(DEFAULT, "default configuration"), Path()) if path is None else (read_toml(path), path.parent)


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
    axles, mapped = _train(top, vehicle, database)
    mapped = [_of_tick(i, design) for i in mapped]
    constant = _constant_speed(limits)
    if constant is None and Quantity.SPEED not in {i.source.quantity for i in mapped}:
        raise vehicle.error(
            "is missing", "speed", 'name the signal ("Message.Signal") or give limits.constant_speed_m_s'
        )
    status, rejects, link = (
        optional(vehicle, key, database, usual, STATUS_MS)
        for key, usual in zip(("status_message", "rejects_message", "link_message"), STATUS_MESSAGES, strict=True)
    )
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
        inputs=tuple(mapped),
        data_ids={i.source.message: data_id(find_message(database, i.source.message)) for i in mapped},
        status=status,
        rejects=rejects,
        link=link,
        not_available_after_us=_not_available_after_us(limits, mapped),
        min_speed_m_s=limits.number("min_speed_m_s", 3.0, 0.1, 60.0),
        constant_speed_m_s=constant,
        torque_is_total=vehicle.get("torque_is_total", bool, True),
        recorder=_recorder(top.section("recorder"), folder),
    )
    for section in (bus, dbc, estimator, limits, vehicle, top):
        section.done()
    _names_the_wheelset(top, dbc, estimator, design)
    return config


def _train(top: Section, vehicle: Section, database: Database) -> tuple[list[AxleConfig], list[Input]]:
    """The axles, and what is mapped for them and for the vehicle."""
    axles: list[AxleConfig] = []
    mapped: list[Input] = []
    sent: set[str] = set()
    tables = list(top.sections("axle"))
    if not 1 <= len(tables) <= MAX_AXLES:
        raise top.error(
            f"takes 1 to {MAX_AXLES} tables, found {len(tables)}", "axle", "write [[axle]] for each wheelset"
        )
    for place, table in enumerate(tables):
        one = axle(table, database)
        if one.number in {a.number for a in axles}:
            raise table.error(f"{one.number} is there twice", "number")
        for key, output in (("adhesion", one.adhesion), ("detail", one.detail), ("inputs", one.inputs)):
            if output is None:
                continue
            if output.message in sent:
                raise table.error(f"{output.message} is sent for another axle already", key)
            sent.add(output.message)
        axles.append(one)
        mapped += inputs(table, database, AXLE_QUANTITIES, (place,))
        table.done()
    mapped += inputs(vehicle, database, VEHICLE_QUANTITIES, tuple(range(len(axles))))
    return axles, mapped


def _of_tick(i: Input, design: Design) -> Input:
    """The measurements run with the ticks: past three of them they are stale, whatever the DBC says."""
    if i.source.quantity not in (Quantity.YAW_RATE, Quantity.LAT_ACCEL):
        return i
    return replace(i, timeout_us=round(STALE_TICKS * design.tick_s * 1e6))


def _constant_speed(limits: Section) -> float | None:
    constant = limits.maybe("constant_speed_m_s", float)
    return None if constant is None else limits.number("constant_speed_m_s", constant, 0.0, Quantity.SPEED.limit)


def _not_available_after_us(limits: Section, mapped: list[Input]) -> int:
    after_us = round(1000 * limits.number("not_available_after_ms", 100.0, 5.0, 10_000.0))
    for i in mapped:
        if i.source.quantity in (*NEEDED, Quantity.SPEED) and i.timeout_us > after_us:
            raise limits.error(
                f"{after_us / 1000:g} ms is less than the time-out of {i.source.message}.{i.source.signal}, "
                f"{i.timeout_us / 1000:g} ms",
                "not_available_after_ms",
                "give a longer one: an input that is silent for so long ends the estimate",
            )
    return after_us


def _recorder(section: Section, folder: Path) -> RecorderConfig:
    # where systemd says that a service may keep things; it may name several, by colons
    given = section.maybe("folder", str) or os.environ.get("STATE_DIRECTORY", "").partition(":")[0]
    max_files = section.get("max_files", int, 20)
    if not 1 <= max_files <= 10_000:
        raise section.error(f"takes 1 … 10000, not {max_files}", "max_files")
    config = RecorderConfig(
        folder=folder / given if given else None,
        seconds=section.number("seconds", 60.0, 0.0, 600.0),
        max_files=max_files,
        max_mb=section.number("max_mb", 200.0, 1.0, 1e6),
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
                "make a design for this wheelset with `sim-ecu design`, and name it under [estimator]",
            )


def _names_the_wheelset(top: Section, dbc: Section, estimator: Section, design: Design) -> None:
    """Whoever brings a train of their own says which wheelset it has: a foreign one cannot be told from its signals,
    only its estimates are wrong."""
    if "file" in dbc and "design" not in estimator and not list(top.section("wheelset")):
        raise dbc.error(
            f"is a train's own, but nothing says that it has the wheelset {_name(design)!r} of the packaged design",
            "file",
            f'name it: [wheelset] name = "{_name(design)}" (or parameters to compare), or [estimator] design = "FILE"',
        )


def _name(design: Design) -> str:
    return str(design.wheelset.get("name", design.name))


def _both_numbers(a: object, b: object) -> bool:
    return all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (a, b))
