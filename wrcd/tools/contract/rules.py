"""The rules of the contract as checks: each plays one thing, and says what the consumer must make of it."""

from collections.abc import Callable
from dataclasses import dataclass

from wrcd.tools.contract.player import Player

PAGE = "docs/reference/what-a-controller-does.md"
ORDER, TIMEOUT, E2E, VALIDITY = "In this order", "Time-out", "E2E", "Validity"
VALUES, CONFIDENCE = "MuAvailable, MuUsed, SampleAge", "Confidence"
SURFACE, CONTACT = "Surface", "ContactState"
FIRST, AXLES = "The first rule", "One axle, or the train"


@dataclass(frozen=True, slots=True)
class Check:
    """One rule. run raises BrokenRule, or CannotPlay."""

    name: str
    section: str  # of the page
    run: Callable[[Player], None]

    @property
    def source(self) -> str:
        """Where the rule stands."""
        return f"{PAGE}, “{self.section}”"


Run = Callable[[Player], None]


def rule(checks: list[Check], section: str) -> Callable[[Run], Run]:
    """Add a function to the checks, under its own name with hyphens."""

    def add(run: Run) -> Run:
        checks.append(Check(run.__name__.replace("_", "-"), section, run))
        return run

    return add
