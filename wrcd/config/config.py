"""The configuration: a TOML file that says which signals carry what, or the default, which is the packaged DBC."""

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

from wrcd import resources
from wrcd.bus.dbc import Database, find_message, find_signal, load_dbc
from wrcd.bus.units import Quantity
from wrcd.config import declared
from wrcd.config.configured_train import ConfiguredTrain, all_statements, axle_tables, read_train
from wrcd.config.ended_keys import take_out
from wrcd.config.input_mapping import STALE_TICKS
from wrcd.config.keys import KeyOf, names
from wrcd.config.outputs import STATUS_MESSAGES, usual_messages
from wrcd.config.packaged_designs import design_path, designs_for
from wrcd.config.section import TO_FILL_IN
from wrcd.config.settings import Section, parse_toml, read_toml, suggest
from wrcd.config.statements import NEEDED, Statement
from wrcd.core.configuration import Config, Input, RecorderConfig
from wrcd.core.design import Design, load_design
from wrcd.errors import InputError, InputErrors

__all__ = ["DEFAULT", "DEFAULT_AXLES", "STALE_TICKS", "load_config", "load_config_to_run", "load_packaged", "packaged"]

T = TypeVar("T")
DEFAULT_AXLES = 4


def packaged(axles: int, positions_m: Sequence[float | None] = ()) -> str:
    """The TOML text that maps the packaged DBC's first axles. positions_m: where each stands, of a train that never
    runs in reverse; None: not known."""
    way = "\none_way = true" if positions_m else ""
    places = ["" if x is None else f"\nposition_m = {x:g}" for x in positions_m or (None,) * axles]
    return f"""
[vehicle]
speed = "VehicleSpeed.Speed"{way}
""" + "".join(
        f"""
[[axle]]
number = {a}{places[a - 1]}
yaw_rate = "YawRate_A{a}.YawRate"
lateral_acceleration = "LatAccel_A{a}.LatAccel"
torque = "Torque_A{a}.Torque"
"""
        for a in range(1, axles + 1)
    )


DEFAULT = packaged(DEFAULT_AXLES)


def load_config(path: Path | None, design_file: Path | None = None) -> Config:
    """Read a configuration file, or the default one for None. Raises InputError with file, line, key and advice: all
    mistakes of the file at once.

    design_file: holds in place of the one that the file names.
    """
    return _config(*_source(path), load_dbc, load_design, design_file)


def mistakes(text: str, file: Path, folder: Path, design: Design) -> Sequence[InputError]:
    """What load_config refuses of a configuration's text, of a design; file: what messages call it, folder: from which
    its paths go."""
    try:
        _config(parse_toml(text, file, collect=True), folder, load_dbc, lambda _: design)
    except InputErrors as e:
        return e.errors
    except InputError as e:
        return (e,)
    return ()


def load_config_to_run(path: Path | None) -> Config:
    """The same for the daemon, sooner: attributes and comments of messages that the configuration cannot mean are not
    parsed."""
    top, folder = _source(path)
    return _config(top, folder, partial(load_dbc, names=_messages(top)), load_design)


def input_mappings(path: Path | None) -> list[Statement]:
    """What a configuration that load_config takes says of its inputs, for a line that changes one."""
    top, _ = _source(path)
    return all_statements(axle_tables(top), top.section("vehicle"))


def load_packaged(axles: int, design: str | None = None, positions_m: Sequence[float | None] = ()) -> Config:
    """The default configuration, but of so many axles, at these positions; with a packaged design instead of the
    default one."""
    estimator = "" if design is None else f'[estimator]\ndesign = "{design}"\n'
    top = parse_toml(packaged(axles, positions_m) + estimator, "default configuration", collect=True)
    return _config(top, Path(), load_dbc, load_design)


def _messages(top: Section) -> set[str]:
    """Names of all messages that a configuration can mean: what it names, and what is sent without being named."""
    named = {text.partition(".")[0] for text in top.strings()}
    numbers = (table.raw("number") for table in top.sections("axle"))
    usual = {name for n in numbers if isinstance(n, int) for name in usual_messages(n)}
    return named.union(usual, STATUS_MESSAGES)


def _source(path: Path | None) -> tuple[Section, Path]:
    """The configuration's top level, and the folder from which its paths go."""
    if path is None:
        return parse_toml(DEFAULT, "default configuration", collect=True), Path()
    return read_toml(path, collect=True), path.parent


def _config(
    top: Section,
    folder: Path,
    read_dbc: Callable[..., Database],
    read_design: Callable[[Path], Design],
    given_design: Path | None = None,
) -> Config:
    """Read it all. What has a mistake is left out or has its default until the end, where mistakes are raised."""
    ended = take_out(top)
    bus, dbc, estimator = top.section("bus"), top.section("dbc"), top.section("estimator")
    limits, vehicle = top.section("limits"), top.section("vehicle")
    read_dbc = partial(read_dbc, encoding=declared.ENCODING.read(dbc))
    own_dbc = declared.DBC_FILE.read(dbc)
    dbc_file = resources.DBC if own_dbc is None else folder / own_dbc
    database = _load(dbc, declared.DBC_FILE, dbc_file, read_dbc)
    design_file, design = _design(estimator, folder, read_design, given_design)
    wheelset = top.section("wheelset")
    if design is not None:
        _same_wheelset(wheelset, estimator, design, design_file)
        if given_design is None:
            _names_the_wheelset(top, wheelset, dbc, estimator, design)
    train = read_train(top, vehicle, database, design)
    constant = declared.CONSTANT_SPEED.read(limits)
    _one_speed(limits, vehicle)
    after_us = _not_available_after_us(limits, train.inputs)
    interface, channel = _interface(bus), declared.CHANNEL.read(bus) or ""
    stamps = declared.TIMESTAMPS.value(bus)
    min_speed, total = declared.MIN_SPEED.value(limits), declared.TORQUE_IS_TOTAL.read(vehicle)
    one_way = declared.ONE_WAY.value(vehicle)
    recorder = _recorder(top.section("recorder"), folder)
    for name, section in (
        ("bus", bus),
        ("dbc", dbc),
        ("estimator", estimator),
        ("limits", limits),
        ("vehicle", vehicle),
    ):
        section.done(names(declared.TABLES[name]))
    top.done((*declared.TABLES, "wheelset"))
    top.finish()
    assert database is not None
    assert design is not None
    status, rejects, link = train.own
    axles = train.axles
    unplaced = _unplaced(train, one_way, database)
    return Config(
        file=str(top.file),
        interface=interface,
        channel=channel,
        hardware_stamps=stamps == "hardware",
        dbc_file=dbc_file,
        database=database,
        design_file=design_file,
        design=design,
        axles=tuple(axles),
        inputs=tuple(train.inputs),
        data_ids=train.data_ids,
        status=status,
        rejects=rejects,
        link=link,
        not_available_after_us=after_us,
        min_speed_m_s=min_speed,
        constant_speed_m_s=constant,
        fuses=not unplaced and any(a.position_m is not None for a in axles),
        torque_is_total=total,
        recorder=recorder,
        warnings=(*ended, *database.warnings, *train.warnings, *unplaced),
    )


def _unplaced(train: ConfiguredTrain, one_way: bool, database: Database) -> list[str]:
    """Why words of axles are not fused though some of them have a position."""
    placed = [a.number for a in train.axles if a.position_m is not None]
    speed = next((i.source for i in train.inputs if i.source.quantity is Quantity.SPEED), None)
    knows_way = one_way or any(i.source.quantity is Quantity.DIRECTION for i in train.inputs)
    if speed is not None and not knows_way:
        signal = find_signal(find_message(database, speed.message), speed.signal)
        knows_way = ((signal.minimum if speed.low is None else speed.low) or 0.0) < 0.0
    why = {
        "another axle's position_m is not given": len(placed) < 2,
        "no signal tells the speed": speed is None,
        "nothing tells which way the train runs; write one_way = true in [vehicle] if it never runs in reverse, "
        "or map vehicle.direction": not knows_way,
    }
    reason = next((text for text, holds in why.items() if holds), "")
    return [f"axle.position_m counts for nothing, each axle stands alone: {reason}"] if placed and reason else []


def _interface(bus: Section) -> str:
    """The interface's name. One that a plugin of python-can brings is known, too."""
    key = declared.INTERFACE.name
    given = bus.maybe(key, str)
    if given is None or given in declared.INTERFACES:
        return given or declared.INTERFACE.value(bus)
    from importlib.metadata import entry_points  # slow, and hardly ever needed

    if given not in entry_points(group="can.interface").names:
        from wrcd.bus.opening_hints import check_interface

        try:
            check_interface(given, declared.INTERFACES)
        except InputError as e:
            bus.refuse(e.reason, key, e.hint)
    return given


def _one_speed(limits: Section, vehicle: Section) -> None:
    """The speed is mapped or constant."""
    speed, constant = Quantity.SPEED.key, declared.CONSTANT_SPEED.name
    if speed in vehicle and constant in limits:
        limits.refuse("is given, and vehicle.speed names a signal", constant, "one of the two: which one holds?")
    elif speed not in vehicle and constant not in limits:
        hint = f"{limits.line(**{constant: TO_FILL_IN})}, or name the signal"
        error = vehicle.absent(speed, hint, "Message.Signal")
        vehicle.mistake(error)
        limits.explains(constant, error)


def _not_available_after_us(limits: Section, mapped: list[Input]) -> int:
    after_us = round(1000 * declared.NOT_AVAILABLE_AFTER.value(limits))
    for i in mapped:
        if i.source.quantity in (*NEEDED, Quantity.SPEED) and i.timeout_us > after_us:
            limits.refuse(
                f"{after_us / 1000:g} ms is less than the time-out of {i.source.message}.{i.source.signal}, "
                f"{i.timeout_us / 1000:g} ms",
                declared.NOT_AVAILABLE_AFTER.name,
                "an input that is silent for so long ends the estimate: "
                + limits.line(**{declared.NOT_AVAILABLE_AFTER.name: i.timeout_us / 1000}),
            )
    return after_us


def _recorder(section: Section, folder: Path) -> RecorderConfig:
    # where systemd says that a service may keep things; it may name several, by colons
    given = declared.FOLDER.read(section) or os.environ.get("STATE_DIRECTORY", "").partition(":")[0]
    config = RecorderConfig(
        folder=folder / given if given else None,
        seconds=declared.SECONDS.value(section),
        max_files=declared.MAX_FILES.value(section),
        max_mb=declared.MAX_MB.value(section),
    )
    section.done(names(declared.TABLES["recorder"]))
    return config


def _design(
    section: Section, folder: Path, read: Callable[[Path], Design], given: Path | None
) -> tuple[Path, Design | None]:
    """The design's file, and the design: given, named by the section, or the default one. None: see _load."""
    if given is not None:
        return given, read(given)
    key = declared.DESIGN
    named = key.read(section)
    file = resources.DESIGN if named is None else design_path(named, folder)
    return file, _load(section, key, file, read)


def _load(section: Section, key: KeyOf[str], path: Path, load: Callable[[Path], T]) -> T | None:
    """Load a file that the configuration names: the error says both where it is named and what is wrong with it.

    None: it has a mistake, or its name has one.
    """
    if key.name in section and key.read(section) is None:
        return None
    with section.collected():
        try:
            return load(path)
        except InputError as e:
            if key.name in section:
                named = section.error(str(e), key.name)
                named.status = e.status
                raise named from None
            raise
    return None


def _same_wheelset(section: Section, estimator: Section, design: Design, file: Path) -> None:
    """[wheelset] in the configuration states what the train has; a design for another one is refused."""
    for key in section:
        if key not in design.wheelset:
            hint = suggest(key, design.wheelset) or f"the design's wheelset has {', '.join(sorted(design.wheelset))}"
            section.refuse("unknown key", key, hint)
            continue
        stated = section.raw(key)
        has = design.wheelset[key]
        same = abs(stated - has) <= 1e-6 * abs(has) if _both_numbers(stated, has) else stated == has
        if not same:
            hint = "make a design for this wheelset with `sim-ecu design`, and name it under [estimator]"
            if key == "name" and (fitting := designs_for(stated)):
                named = " or ".join(estimator.line(design=one) for one in fitting)
                hint = f"{section.line(name=has)}, if the train has that one; for {stated!r} {named}"
            section.refuse(
                f"is {stated!r}, but the design file {file} is for a wheelset with {has!r}",
                key,
                hint,
            )


def _names_the_wheelset(top: Section, wheelset: Section, dbc: Section, estimator: Section, design: Design) -> None:
    """Whoever brings a train of their own says which wheelset it has: the signals of many a foreign one look
    alike, and its estimates are wrong."""
    key = declared.DBC_FILE.name
    if key not in dbc or declared.DESIGN.name in estimator or list(wheelset):
        return
    error = dbc.error(
        f"is a train's own, but nothing says that it has the wheelset {_name(design)!r} of the default design",
        key,
        f"{wheelset.line(name=_name(design))} (or parameters to compare), or {estimator.line(design='NAME or FILE')}",
    )
    dbc.mistake(error)
    for section, absent in ((top, "wheelset"), (top, "estimator"), (estimator, declared.DESIGN.name)):
        section.explains(absent, error)


def _name(design: Design) -> str:
    return str(design.wheelset.get("name", design.name))


def _both_numbers(a: object, b: object) -> bool:
    return all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (a, b))
