"""What a slot's frames are made from, taken down at its begin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wrcd.bus.codec import Value
from wrcd.core.causes import Cause, Validity
from wrcd.core.messages import (
    Outbox,
    Outgoing,
    Report,
    confidence,
    explanation,
    nan_to_none,
    plausibility,
    surface,
)
from wrcd.core.records import Estimate
from wrcd.core.terms import EstimateDoubt
from wrcd.core.validity import Standing, verdict


@dataclass(frozen=True, slots=True)
class Slot:
    """Lists by axle. estimate is None where no axle has an estimate."""

    end_us: int
    estimate: Estimate | None
    due: Sequence[int]  # cycles of the frames that are due
    adhesion: Sequence[int]  # axles (places) whose adhesion is due
    detail: bool  # whether a frame that explains it is
    standing: Sequence[Standing]
    details: Mapping[int, str]  # of the axles (places) whose standing has changed: how it is, in figures
    age_ms: Sequence[int]
    torque_ratio: Sequence[float]
    stale: Sequence[set[int]]  # quantities
    inputs: Sequence[Mapping[str, Value]]  # values of the frames about the inputs, where they are due
    status: Sequence[Outgoing]


def reports(slot: Slot, before: Sequence[str]) -> list[Report]:
    """The reports of every axle. before: their Confidence at the slot before."""
    return [_report(slot, axle, level) for axle, level in enumerate(before)]


def frames(slot: Slot, reported: Sequence[Report], outbox: Outbox) -> list[Outgoing]:
    """The frames of the slot."""
    estimate = slot.estimate
    out: list[Outgoing] = []
    if slot.adhesion:
        out += outbox.adhesion(slot.end_us, slot.due, reported, estimate)
    if slot.detail:
        known = [estimate if standing.has_estimate else None for standing in slot.standing]
        out += outbox.detail(
            slot.end_us,
            slot.due,
            [explanation(e, axle, slot.stale[axle], reported[axle].cause.label) for axle, e in enumerate(known)],
            [{"Plausibility": plausibility(e, axle), **slot.inputs[axle]} for axle, e in enumerate(known)],
        )
    out += slot.status
    return out


def _report(slot: Slot, axle: int, before: str) -> Report:
    estimate = slot.estimate
    age_ms, used = slot.age_ms[axle], nan_to_none(min(100.0 * slot.torque_ratio[axle], 100.0))
    validity, cause = verdict(slot.standing[axle], axle, estimate)
    if validity is Validity.NOT_AVAILABLE or estimate is None:
        return Report(validity, None, used, age_ms, "Unknown", "Unknown", "None", cause)
    mu = nan_to_none(float(estimate.mu_available_pct[axle]))
    sure = validity is Validity.VALID and mu is not None
    if sure and used is not None and mu is not None:
        # what the newest torque is beyond the newest part's mean turns the wheel, or is its sensor's noise
        used = min(used, mu)
    contact = "Unknown" if mu is None else "Saturated" if estimate.saturated[axle] else "Adhering"
    width = nan_to_none(float(estimate.half_width_pp[axle])) if sure else None
    short = cause is Cause.TOO_LITTLE_DATA and estimate.doubt[axle] != EstimateDoubt.GAPS
    level = confidence(width, before)
    return Report(validity, mu, used, age_ms, surface(mu), contact, level, cause, short)
