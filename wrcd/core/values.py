"""The values of the messages beside Adhesion: why an estimate is what it is, and how the daemon and its bus are."""

import math
from collections.abc import Mapping

from wrcd.bus.codec import Value
from wrcd.bus.link import LinkHealth
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.counts import Counts, Health
from wrcd.core.inputs import LAT, SPEED, TORQUE, YAW
from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import MODELS
from wrcd.estimator.estimator import Estimate

NAMES = {YAW: "YawRate", LAT: "LatAccel", TORQUE: "Torque", SPEED: "Speed"}  # as the DBC's signals end


def explanation(estimate: Estimate | None, axle: int, stale: BoolArray, cause: Cause) -> dict[str, Value]:
    """AdhesionDetail of an axle; without an estimate only the cause and which inputs (quantities,) are stale."""
    values: dict[str, Value] = {f"Stale{name}": float(stale[q]) for q, name in NAMES.items()}
    values["Cause"] = cause.label
    values["WinningModel"] = float(estimate.winner[axle]) if estimate else 0.0
    values["DominantRule"] = float(estimate.rule[axle]) if estimate else None
    for m in range(MODELS):
        r = float(estimate.residuals[axle, m]) if estimate else math.nan
        values[f"Residual{m + 1}"] = 20 * math.log10(r) if math.isfinite(r) else None
    return values


def plausibility(estimate: Estimate | None, axle: int) -> str:
    """More in use than available is saturation, or something is wrong: which."""
    if estimate is None or not math.isfinite(estimate.mu_available_pct[axle]):
        return "Unknown"
    if estimate.contradicted[axle]:
        return "Contradiction"
    return "Saturated" if estimate.saturated[axle] else "Consistent"


def health_values(health: Health, counts: Counts, design_checksum: str) -> dict[str, Value]:
    """WrcdStatus."""
    return {
        "State": health.state,
        "Overruns": float(health.overruns % 256),
        "RejectedFrames": float(counts.rejected.total() % 1024),
        "LastReason": counts.last_reason,
        "ReceiveDrops": float(health.link.drops % 64),
        "Reopens": float(health.link.reopens % 16),
        "DesignChecksum": float(int(design_checksum[:4], 16)),
    }


def reject_values(new: Mapping[Reason, int]) -> dict[str, Value]:
    """WrcdRejects, of the rejections since the last."""
    return {f"Rejected{r.label}": float(min(new.get(r, 0), 15)) for r in Reason}


def link_values(link: LinkHealth, counts: Counts, outliers: int) -> dict[str, Value]:
    """WrcdLink."""
    return {
        "LinkState": link.state,
        "ErrorFrames": float(link.error_frames % 4096),
        "BusOffs": float(link.bus_offs % 16),
        "Unsent": float(link.unsent % 256),
        "TimeSteps": float(counts.time_steps % 16),
        "LateFrames": float(counts.late % 16),
        "Outliers": float(outliers % 256),
        "Restarts": float(counts.restarts % 256),
    }
