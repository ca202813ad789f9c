"""The suites of `sim-ecu score`, in the order of the report: known to its command line without what plays them."""

SUITES = (
    "paper", "grid", "robust", "rough", "harsh", "slow", "transitions", "drops", "cycles", "dead", "foreign",
    "dry-hours",
)  # fmt: skip
