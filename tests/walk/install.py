"""Install: with units, under a real systemd, in the guest; upgraded and removed there: tests/walk/in_guest.py."""

import re

from tests.walk.walk import ROOT, Step, Walk, expect

SECONDS = 240.0


def take(walk: Walk) -> str:
    """What would be installed is laid out here, as pip does it, for the guest has no network."""
    unit, ours = walk.folder / "build/unit", ROOT / "build/unit"
    if ours.is_dir():
        unit.symlink_to(ours)  # taken as it is if it is the clone's very state, else laid out anew
    walk.run("tests/hil/unit-env", seconds=SECONDS)
    guest = ("tests/hil/guest/run", "--systemd", "--", ".venv/bin/python", "-m", "tests.walk.in_guest")
    said = walk.run(*guest, seconds=SECONDS)
    (walk.out / "install.txt").write_text(said)
    seen = re.findall(r"(?m)^seen: (.*)$", said)
    expect(len(seen) == 4, f"only {len(seen)} of four things were seen:\n{said}")
    return "; ".join(seen)


STEP = Step("install", take)
