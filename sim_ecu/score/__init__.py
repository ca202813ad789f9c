"""How good the estimate is: accuracy, and the figures of the paper; here the suites."""

SUITES = (
    "paper", "grid", "robust", "rough", "harsh", "slow", "worlds", "long", "canted", "peak", "transitions", "drops",
    "cycles", "dead", "foreign", "dry-hours",
)  # fmt: skip
# Of a train, whatever the design's vehicle is; played only where requested: it takes a quarter of an hour on two cores.
WORLDS = "worlds"
MISSED = "missed"  # what --fail-on may name
