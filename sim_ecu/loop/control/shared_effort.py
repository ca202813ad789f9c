"""How axles share the driver's brake demand: what one rail does not carry goes to the axles whose rail does."""

from collections.abc import Sequence

CARRIED_SHARE = 0.85  # of the lower end of an axle's adhesion that it is asked for; our choice


def carried_N_m(mu: float, half_width: float, unit_N_m: float) -> float:
    """|torque| that an axle is trusted to carry, from the lower end of its adhesion (ratios).

    unit_N_m: torque at the wheelset that takes an adhesion of 1.
    """
    return CARRIED_SHARE * max(mu - half_width, 0.0) * unit_N_m


def shared_effort(demand_N_m: float, carried_N_m: Sequence[float | None], most_N_m: Sequence[float]) -> list[float]:
    """|torque| to ask of each axle (N m), in place of the driver's demand of every axle. The sum stays.

    carried_N_m: what each is trusted to carry; None: not known, it keeps the driver's demand. most_N_m: what the
    actuators of each can give. An axle that carries less than the demand gives up what the others have room for, each
    in proportion to what it lacks; an axle takes in proportion to its room.
    """
    known = [demand_N_m if c is None else c for c in carried_N_m]
    lacks = [max(demand_N_m - c, 0.0) for c in known]
    room = [max(min(c, most) - demand_N_m, 0.0) for c, most in zip(known, most_N_m, strict=True)]
    lacking, spare = sum(lacks), sum(room)
    moved = min(lacking, spare)
    if moved <= 0.0:
        return [demand_N_m] * len(known)
    return [demand_N_m + moved * (more / spare - less / lacking) for less, more in zip(lacks, room, strict=True)]
