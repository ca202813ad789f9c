"""The logs of the corpus: each a configuration, a ride of the rig, and what the bus does to its frames, from seeds."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.track import SPECTRA
from sim_ecu.play.faults import KINDS, Stage
from sim_ecu.resources import SCENARIOS
from tests.matrix.expected import LONG_ROWS, ROWS, MatrixRow
from wrcd.config.config import packaged
from wrcd.resources import DEFAULT_DESIGN, LONE

DESIGNS = (DEFAULT_DESIGN, LONE)
ODD, FLOATS = "tests/data/dbc/odd.toml", "tests/data/dbc/floats.toml"
SIGNED = "signed.dbc"  # the packaged DBC, with a speed that may be below zero
OWN = {  # configurations with a DBC of their own, and their axles
    "examples/own-dbc/train.toml": (1,), "tests/data/dbc/third-party.toml": (1, 2), ODD: (1, 2),
    FLOATS: (1,),
}  # fmt: skip
LIMITS = (
    "min_speed_m_s = 12.0", "min_speed_m_s = 0.1", "not_available_after_ms = 60", "not_available_after_ms = 4000",
    "constant_speed_m_s = 20.0",
)  # fmt: skip
# what is wrong with a configuration that another one has played
MISTAKES = (
    (ODD, 'axle_load = "Train.Load"', 'axle_load = { signal = "Train.Load", scale = 1.5 }'),
    (ODD, 'wheel_radius = "Train.Radius"', 'wheel_radius = { signal = "Train.Radius", scale = 0.013 }'),
    (ODD, '"Imu1.Turn", sign = -1', '"Imu1.Turn"'),
    (ODD, '"Effort.Motor1"', '"Effort.Motor1", sign = -1'),
    (ODD, 'signal = "Imu2.Side", scale = 0.00002', 'signal = "Imu2.Side", scale = 0.0000002'),
    (ODD, 'direction = { signal = "Train.Way", reverse = ["reverse"] }', ""),
    ("examples/own-dbc/train.toml", 'brake_torque = "BCU1.BrakeEffort"', ""),
)
OF_AXLE = ("yaw_rate", "lateral_acceleration", "torque", "all")


@dataclass(frozen=True, slots=True)
class Recipe:
    """A log: its configuration (a file of the repository, or TOML), its scenario as TOML, the seed of what the bus does
    to its frames (None: nothing), from when on the train says that it runs in reverse (s; its DBC must have it), and
    what the configuration by which the log is replayed has otherwise: (old, new)."""

    name: str
    config: str
    scenario: str
    spoilt: int | None = None
    reverse_from_s: float | None = None
    misheard: tuple[str, str] | None = None


def configuration(axles: int, design: str, more: str = "") -> str:
    """The packaged DBC with so many axles."""
    return f'{packaged(axles)}\n[estimator]\ndesign = "{design}"\n{more}'


def recipes() -> Iterator[Recipe]:
    """All of them."""
    yield from _matrix()
    yield from _axles()
    yield from _packaged_rides()
    yield from _situations()
    yield from _fuzzed()
    yield from _own_dbcs()
    yield from _mistakes()
    yield from _limits()


def _matrix() -> Iterator[Recipe]:
    """Every row of the fault matrix, on an axle and beside its twin, and how the axle goes on after it. In a log the
    three faults of the interface are one, a silence."""
    for design in DESIGNS:
        for number, row in enumerate((*ROWS, *LONG_ROWS)):
            f = row.fault
            yield Recipe(
                f"fault {number:02d} {f.kind} {f.of} {f.duration_s:g} {design}", configuration(2, design),
                f'duration_s = {3.0 + f.duration_s + 3.5}\nvehicle = "{design}"\naxles = [1, 2]\nspeed_m_s = 25.0\n'
                'track = "poor"\nrail = [{ curve = "C" }]\ndrive = { utilisation = [[0, 0], [0.5, 0.5]] }\n'
                f"{_fault(row)}",
            )  # fmt: skip


def _fault(row: MatrixRow) -> str:
    f = row.fault
    of = "" if KINDS[f.kind].stage is Stage.BUS else f'of = "{f.of}"\naxle = 1\n'
    amount = "" if f.amount is None else f"amount = {f.amount}\n"
    return f'[[fault]]\nkind = "{f.kind}"\nat_s = 3.0\nduration_s = {f.duration_s}\n{of}{amount}'


def _axles() -> Iterator[Recipe]:
    for design in DESIGNS:
        for axles in range(1, 9):
            chance = np.random.default_rng([axles, 1])
            yield Recipe(f"axles {axles} {design}", configuration(axles, design), _ride(chance, design, axles, 8.0))


def _packaged_rides() -> Iterator[Recipe]:
    for path in sorted(SCENARIOS.glob("*.toml")):
        text = path.read_text()
        axles = 6 if "six" in path.stem else 4 if "four" in path.stem else 1
        for design in DESIGNS:
            named = "" if "vehicle =" in text else f'vehicle = "{design}"\n'
            yield Recipe(f"ride {path.stem} {design}", configuration(axles, design), named + text)


def _situations() -> Iterator[Recipe]:
    """Stops, curves, drops, standstill, and a train that begins to run in reverse."""
    for design in DESIGNS:
        for seed in range(8):
            for what, make in (("stop", _stop), ("curve", _curve), ("drop", _drop), ("standstill", _standstill)):
                chance = np.random.default_rng([seed, ord(what[0]), ord(what[1])])
                axles = int(chance.integers(1, 5))
                head = f'vehicle = "{design}"\naxles = {list(range(1, axles + 1))}\nseed = {seed + 1}\n'
                yield Recipe(f"{what} {seed} {design}", configuration(axles, design), head + make(chance))
    for seed in range(8):
        chance = np.random.default_rng([seed, 9])
        ride = _ride(chance, DEFAULT_DESIGN, 2, 8.0)
        design, (slow, faster) = DESIGNS[seed % 2], chance.uniform(0.4, 0.7, 2)
        turn = (
            f'vehicle = "{design}"\nduration_s = 16.0\nseed = {seed + 1}\naxles = [1, 2]\ntrack = "poor"\n'
            f"speed_m_s = [[0, 2], [4, 0], [5, {slow:.2f}], [10, {faster:.2f}], [16, 9]]\n"
            'rail = [{ curve = "B" }]\ndrive = { utilisation = [[0, 0], [1, 0.4]] }\n'
        )
        config = configuration(2, design, f'[dbc]\nfile = "{SIGNED}"\n[limits]\nmin_speed_m_s = 0.1\n')
        yield Recipe(f"reverse by speed {seed}", config, turn, None if seed < 4 else seed, 4.0)
        yield Recipe(f"reverse {seed}", ODD, ride, None if seed < 4 else seed, float(chance.uniform(0.0, 6.0)))


def _stop(chance: np.random.Generator) -> str:
    curve, speed, torque = chance.choice(list(CURVES)), chance.uniform(8.0, 14.0), chance.uniform(6e3, 14e3)
    return (
        f'duration_s = 16.0\nspeed_m_s = {speed:.2f}\nhold_speed = false\ntrack = "{chance.choice(list(SPECTRA))}"\n'
        f'rail = [{{ curve = "{curve}" }}]\ndrive = {{ torque_N_m = [[0, 0], [1.5, 0], [2, {-torque:.0f}]] }}\n'
    )


def _curve(chance: np.random.Generator) -> str:
    radius, cant = chance.choice([-1, 1]) * chance.uniform(300.0, 2000.0), chance.uniform(0.0, 0.1)
    return (
        f'duration_s = 10.0\nspeed_m_s = {chance.uniform(12.0, 30.0):.2f}\ntrack = "{chance.choice(list(SPECTRA))}"\n'
        f'drive = {{ utilisation = [[0, 0], [1, {chance.uniform(-0.9, 0.9):.2f}]] }}\n[[rail]]\ncurve = "B"\n'
        f'[[rail]]\nfrom_m = 60.0\ncurve = "{chance.choice(list(CURVES))}"\nradius_m = {radius:.0f}\n'
        f"cant_rad = {cant:.3f}\ntransition_m = 40.0\n"
    )


def _drop(chance: np.random.Generator) -> str:
    sections = "".join(
        f'[[rail]]\nfrom_m = {at}\ncurve = "{chance.choice(list(CURVES))}"\nedge_m = {chance.uniform(0.5, 20.0):.1f}\n'
        for at in (0, 60, 120)
    )
    demand = chance.choice(["creep_of_peak", "utilisation"])
    return (
        f'duration_s = 9.0\nspeed_m_s = 25.0\ntrack = "{chance.choice(list(SPECTRA))}"\n'
        f"drive = {{ {demand} = [[0, 0], [1, {chance.uniform(0.3, 1.1):.2f}]] }}\n{sections}"
    )


def _standstill(chance: np.random.Generator) -> str:
    wait = chance.uniform(2.0, 4.0)
    return (
        f"duration_s = 14.0\nspeed_m_s = [[0, 0], [{wait:.2f}, 0], [{wait + 4.0:.2f}, 12], [14, 2]]\n"
        f'track = "{chance.choice(list(SPECTRA))}"\nrail = [{{ curve = "B" }}]\ndrive = {{ torque_N_m = 4000.0 }}\n'
    )


def _ride(chance: np.random.Generator, design: str, axles: int, seconds: float) -> str:
    """Any ride: rails, a demand, speeds, a track, sensors, a shaken axle box."""
    begin, end = chance.uniform(2.0, 40.0, 2)
    sections = "".join(
        f'[[rail]]\nfrom_m = {at:.0f}\ncurve = "{chance.choice(list(CURVES))}"\n'
        for at in (0.0, *np.sort(chance.uniform(20.0, 200.0, int(chance.integers(0, 3)))))
    )
    drive = (
        f"torque_N_m = [[0, 0], [1, {chance.uniform(-2e4, 2e4):.0f}]]",
        f"utilisation = [[0, 0], [1, {chance.uniform(-1.0, 1.0):.2f}]]",
        f"creep_of_peak = [[0, 0], [1, {chance.uniform(-2.0, 2.0):.2f}]]",
    )[chance.integers(3)]
    vibration, joint = chance.uniform(0.0, 20.0), chance.uniform(0.0, 30.0)
    shaken = f"axlebox = {{ vibration_m_s2 = {vibration:.1f}, joint_m_s2 = {joint:.1f} }}\n" * (chance.random() < 0.4)
    return (
        f'duration_s = {seconds}\nvehicle = "{design}"\naxles = {list(range(1, axles + 1))}\n'
        f"seed = {chance.integers(1, 1000)}\nspeed_m_s = [[0, {begin:.1f}], [{seconds}, {end:.1f}]]\n"
        f'track = "{chance.choice(list(SPECTRA))}"\nsensors = "{chance.choice(list(SENSOR_SETS))}"\n{shaken}'
        f"drive = {{ {drive} }}\n{sections}"
    )


def _faults(chance: np.random.Generator, axles: int, seconds: float) -> str:
    """Up to three faults of any kind."""
    kinds = [k for k in KINDS if axles > 1 or not k.startswith("swap")]
    tables = []
    for _ in range(chance.integers(0, 4)):
        kind = str(chance.choice(kinds))
        of = "speed" if chance.random() < 0.2 and not kind.startswith("swap") else chance.choice(OF_AXLE)
        where = "" if KINDS[kind].stage is Stage.BUS else f'of = "{of}"\naxle = {chance.integers(1, axles + 1)}\n'
        tables.append(
            f'[[fault]]\nkind = "{kind}"\nat_s = {chance.uniform(0.0, seconds - 1.0):.3f}\n'
            f"duration_s = {chance.choice([0.01, 0.1, 0.5, 2.0])}\n{where}"
        )
    return "".join(tables)


def _fuzzed() -> Iterator[Recipe]:
    for seed in range(176):
        chance = np.random.default_rng([seed, 2])
        design, axles, seconds = DESIGNS[seed % 2], seed // 2 % 8 + 1, float(chance.uniform(6.0, 14.0))
        ride = _ride(chance, design, axles, round(seconds, 1)) + _faults(chance, axles, seconds)
        yield Recipe(f"fuzzed {seed:03d} {axles} {design}", configuration(axles, design), ride, seed)


def _own_dbcs() -> Iterator[Recipe]:
    for path, axles in OWN.items():
        for seed in range(16):
            chance = np.random.default_rng([seed, 3])
            design = LONE if "floats" in path else DEFAULT_DESIGN
            ride = _ride(chance, design, len(axles), 8.0)
            yield Recipe(f"own {path} {seed:02d}", path, ride, None if seed < 6 else seed)


def _mistakes() -> Iterator[Recipe]:
    for number, (path, *edit) in enumerate(MISTAKES):
        for seed in range(3):
            chance = np.random.default_rng([seed, number, 6])
            ride = _ride(chance, DEFAULT_DESIGN, len(OWN[path]), 12.0)
            yield Recipe(f"mistake {number} {seed}", path, ride, None if seed else seed, misheard=(edit[0], edit[1]))


def _limits() -> Iterator[Recipe]:
    for design in DESIGNS:
        for number, limit in enumerate(LIMITS):
            chance = np.random.default_rng([number, 4])
            config = configuration(3, design, f"[limits]\n{limit}\n")
            if "constant" in limit:
                config = config.replace('[vehicle]\nspeed = "VehicleSpeed.Speed"\n', "")
            yield Recipe(f"limits {limit} {design}", config, _ride(chance, design, 3, 8.0), number)
