"""The wrcd command."""

import os
from collections.abc import Sequence

from wrcd.cli.program import Program

WRCD = Program(
    "wrcd",
    "The wheel-rail condition daemon: adhesion from yaw rate, lateral acceleration, torque.",
    "wrcd.cli",
    (
        "run",
        "check",
        "dump",
        "monitor",
        "replay",
        "report",
        "why",
        "init",
        "lint",
        "kit",
    ),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit status: see Status."""
    # one thread: the bank's products are a few hundred numbers. numpy reads it when it is imported
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    return WRCD.run(argv)
