"""The suites of `sim-ecu score`, in the order of the report: known to its command line without what plays them.

FUSION is of what the daemon does beside the estimate, and off by default: it is played where it is asked for alone."""

SUITES = (
    "paper", "grid", "robust", "rough", "harsh", "slow", "long", "canted", "peak", "transitions", "drops", "cycles",
    "dead", "foreign", "dry-hours",
)  # fmt: skip
FUSION = "fusion"
MISSED = "missed"  # what --fail-on may name
