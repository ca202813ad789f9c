"""What the browser words its explanations with, and the texts of events."""

from typing import Any

from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.vocabulary import CONFIDENCES, MESSAGES, Words
from wrcd.tools import explain
from wrcd.tools.report.tables import VALIDITIES
from wrcd.tools.story.records import Story


def words(story: Story) -> dict[str, Any]:
    """Of one side: models, rules as sentences, the texts of events by axle."""
    design = story.config.design
    return {
        "begin_us": story.begin_us,
        "end_s": (story.end_us - story.begin_us) / 1e6,
        "axles": [a.number for a in story.axles],
        "models": list(design.model_names),
        "rules": [explain.sentence(design, r) for r in range(len(design.rules))],
        "details": {str(a.number): [e.detail for e in a.events] for a in story.axles},
        "r0": design.r_0,
        "normal": design.normal_N,
    }


def vocabulary() -> dict[str, Any]:
    """The words that are the same for every log."""
    adhesion, inputs = MESSAGES["adhesion"], MESSAGES["inputs"]
    out: dict[str, Any] = {
        "validity": [v.value for v in VALIDITIES],
        "causes": {int(c): [c.label, c.words] for c in Cause},
        "half": [None, *(w if w < 1e9 else None for w, _ in CONFIDENCES)],
        "reasons": ["", *(r.value for r in Reason)],
        "inputs": ["yaw rate", "lateral acceleration", "torque", "speed"],
    }
    for name, kind in (
        ("contact", adhesion["ContactState"]), ("surface", adhesion["Surface"]), ("confidence", adhesion["Confidence"]),
        ("plausibility", inputs["Plausibility"]),
    ):  # fmt: skip
        assert isinstance(kind, Words)
        out[name] = list(kind.words)
    return out
