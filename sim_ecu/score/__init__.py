"""How good the estimate is: accuracy, and the figures of the paper; here the suites."""

SUITES = (
    "paper", "grid", "robust", "rough", "harsh", "slow", "worlds", "long", "canted", "peak", "transitions", "drops",
    "cycles", "dead", "foreign", "dry-hours", "map",
)  # fmt: skip
# Of a train, whatever the design's vehicle is; played only where requested: they take five and some twenty minutes.
WORLDS, MAP = "worlds", "map"
ON_REQUEST = (WORLDS, MAP)
MISSED = "missed"  # what --fail-on may name
