"""[fusion]: where the axles stand, and whether what is seen ahead can be reported at all."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from wrcd.bus.units import Quantity
from wrcd.config import declared
from wrcd.config.keys import names
from wrcd.config.section import Section
from wrcd.core.configuration import AxleConfig
from wrcd.core.vocabulary import DROP_AHEAD
from wrcd.estimator.design import Design
from wrcd.estimator.signals.drops import TICK_S

LONGEST_M, NEAREST_M = 400.0, 0.5  # from first to last axle; from one to the next


def read_positions(top: Section, axles: Sequence[AxleConfig], design: Design | None) -> tuple[float, ...] | None:
    """Where the axles stand (m); None: there is no [fusion], or it has a mistake, which is collected.

    axles: as far as they have no mistakes of their own.
    """
    if "fusion" not in top:
        return None
    section, key = top.section("fusion"), declared.POSITIONS
    given = None
    with section.collected():
        given = key.read(section)
        if given is not None:
            _check_places(section, given, len(list(top.sections("axle"))))
    _check_order(section, top)
    if design is not None and abs(design.tick_s - TICK_S) > 1e-9:
        reason = f"takes a design with a tick of {1000 * TICK_S:g} ms, not {1000 * design.tick_s:g} ms"
        section.refuse(reason, key.name, "the signs of a drop are set for it: leave [fusion] out")
    if given is not None and len(axles) == len(given) and not any(_tells(a) for a in axles):
        reason = f"would be told by nothing: the DBC has neither AdhesionAhead nor a Cause with {DROP_AHEAD}"
        hint = "add messages such as the packaged DBC's AdhesionAhead_A1, or name them by ahead in [[axle]]"
        section.refuse(reason, key.name, hint)
    section.done(names(declared.TABLES["fusion"]))
    return given


def untold(positions_m: Sequence[float] | None, axles: Sequence[AxleConfig]) -> Iterator[str]:
    """Warnings of the axles that nothing can be reported to."""
    if positions_m is not None:
        for axle in axles:
            if not _tells(axle):
                yield f"fusion: axle {axle.number} sends neither AdhesionAhead nor {DROP_AHEAD}: it is never warned"


def _tells(axle: AxleConfig) -> bool:
    """Whether a frame of the axle can say that a drop lies ahead."""
    cause = None if axle.detail is None else axle.detail.signals.get("Cause")
    return axle.ahead is not None or (cause is not None and DROP_AHEAD in (cause.words or {}))


def _check_places(section: Section, given: Sequence[float], axles: int) -> None:
    key, hint = declared.POSITIONS.name, "m along the train, forward positive"
    if len(given) != axles:
        raise section.error(f"has {len(given)} numbers for {axles} axles", key, "one for each [[axle]], in their order")
    if len(set(given)) != len(given):
        raise section.error("has two axles at one place", key, hint)
    sorted_m = sorted(given)
    if sorted_m[-1] - sorted_m[0] > LONGEST_M:
        raise section.error(f"has axles more than {LONGEST_M:g} m apart", key, hint)
    if any(b - a < NEAREST_M for a, b in pairwise(sorted_m)):
        raise section.error(f"has axles less than {NEAREST_M:g} m apart", key, hint)


def _check_order(section: Section, top: Section) -> None:
    """Which axle leads, and how far the train comes, must be known. Mistakes are collected."""
    direction, key = Quantity.DIRECTION.key, declared.ONE_WAY.name
    vehicle = top.section("vehicle")
    if not declared.ONE_WAY.read(section) and direction not in vehicle:
        reason = "is not true, and vehicle.direction names no signal: which axle leads in reverse?"
        error = section.error(
            reason,
            key,
            f"{vehicle.line(direction='Message.Signal')}; of a train that never runs in reverse, "
            f"{section.line(one_way=True)}",
        )
        section.mistake(error)
        section.explains(key, error)
        vehicle.explains(direction, error)
    if declared.CONSTANT_SPEED.name in top.section("limits"):
        reason = f"needs a speed that is heard, and limits.{declared.CONSTANT_SPEED.name} is given"
        hint = "name the signal in vehicle.speed, or leave [fusion] out"
        section.refuse(reason, declared.POSITIONS.name, hint)
