"""[suspension] of a vehicle's file: parts as data sheets give them, made to the constants of [vehicle].

A constant is `count` times the sum of its parts; a yaw stiffness or damping is that times the square of half the way
from the left part to the right one. A bush stands beside its spring, so both are added.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from sim_ecu.play import scenario_keys as keys
from wrcd.config.settings import Section


@dataclass(frozen=True, slots=True)
class MadeOf:
    """A constant of [vehicle], and the keys of [suspension] that it is made of."""

    constant: str
    parts: tuple[str, ...]
    spacing: str | None = None  # from the left part to the right one, of a yaw constant
    count: str | None = None  # of like parts; None: two, a left and a right one


CONSTANTS = (
    MadeOf("primary_lateral_N_m", ("axle_box_lateral_N_m", "bush_lateral_N_m")),
    MadeOf("primary_lateral_damping_N_s_m", ("axle_box_lateral_damping_N_s_m",)),
    MadeOf("primary_yaw_N_m_rad", ("axle_box_longitudinal_N_m", "bush_longitudinal_N_m"), "axle_box_spacing_m"),
    MadeOf("primary_yaw_damping_N_m_s_rad", ("axle_box_longitudinal_damping_N_s_m",), "axle_box_spacing_m"),
    MadeOf("secondary_lateral_N_m", ("secondary_spring_lateral_N_m",)),
    MadeOf("secondary_lateral_damping_N_s_m", ("lateral_damper_N_s_m",), count="lateral_dampers"),
    MadeOf("secondary_yaw_N_m_rad", ("secondary_spring_longitudinal_N_m",), "secondary_spring_spacing_m"),
    MadeOf("secondary_yaw_damping_N_m_s_rad", ("yaw_damper_N_s_m",), "yaw_damper_spacing_m", "yaw_dampers"),
)


@dataclass(frozen=True, slots=True)
class Converted:
    """A constant's value, and how it came about."""

    constant: str
    value: float
    words: str


def read_suspension(top: Section) -> dict[str, Converted]:
    """Constants of [vehicle] that a file's [suspension] gives, by name. Raises InputError for a part without its
    spacing, a spacing without its part, and a constant that [vehicle] gives, too."""
    section = top.section("suspension")
    read = {key.name: key.read(section) for key in keys.SUSPENSION}
    given = {name: value for name, value in read.items() if value is not None and name in section}
    vehicle = top.raw("vehicle")
    made = {}
    for of in CONSTANTS:
        parts = [name for name in of.parts if name in given]
        if not parts:
            continue
        if of.spacing is not None and of.spacing not in given:
            raise section.error(f"needs {of.spacing}, too", parts[0], "from the left part to the right one, in m")
        if isinstance(vehicle, dict) and of.constant in vehicle:
            raise section.error(f"[vehicle] gives {of.constant}, too", parts[0], "leave one of them out")
        made[of.constant] = _converted(of, parts, given)
    for name in given:
        users = [of for of in CONSTANTS if name in (*of.parts, of.spacing, of.count)]
        if not any(of.constant in made for of in users):
            raise section.error(f"nothing needs it without {' or '.join(users[0].parts)}", name, "leave it out")
    section.done()
    return made


def _converted(of: MadeOf, parts: list[str], given: dict[str, float]) -> Converted:
    count = 2.0 if of.count is None else given.get(of.count, 2.0)
    half = 1.0 if of.spacing is None else 0.5 * given[of.spacing]
    total = sum(given[name] for name in parts)
    added = " + ".join(f"{given[name]:g}" for name in parts)
    added = f"({added})" if len(parts) > 1 else added
    arm = "" if of.spacing is None else f" x ({given[of.spacing]:g} / 2)^2"
    value = count * total * half**2
    return Converted(of.constant, value, f"{of.constant} = {count:g} x {added}{arm} = {value:.4g}")


def conversions(top: Section) -> Iterator[str]:
    """A line for each constant that [suspension] gives. Raises InputError."""
    return (made.words for made in read_suspension(top).values())
