"""The estimate does not depend on where time begins: a log shifted by a whole multiple of all periods gives the same
frames."""

from pathlib import Path

import pytest

from wrcd.bus.candump import stamp_text
from wrcd.cli.main import main

GOLDEN = Path(__file__).parents[2] / "golden" / "leaf-film.log"
# Slots, E2E counters, and the blocks of the estimator's longest window come again after it.
PERIOD_US = 15 * 60_000_000
LOG_US = 1_700_000_000_000_000  # when the log begins
BEFORE_US = LOG_US // PERIOD_US * PERIOD_US


def replayed(shift_us: int, folder: Path) -> list[tuple[int, str]]:
    """Frames that come of the golden log so much earlier: stamps as they were, and what follows them."""
    log, out = folder / "log.log", folder / "out.log"
    lines = GOLDEN.read_text().splitlines()
    stamps = [round(float(line[1:18]) * 1e6) - shift_us for line in lines]
    log.write_text("".join(f"({stamp_text(us)}{line[18:]}\n" for us, line in zip(stamps, lines, strict=True)))
    assert main(["replay", str(log), "-o", str(out)]) == 0
    made = (line.split(maxsplit=1) for line in out.read_text().splitlines())
    return [(round(float(stamp[1:-1]) * 1e6) + shift_us, rest) for stamp, rest in made]


@pytest.mark.parametrize(
    "shift_us",
    [BEFORE_US, LOG_US, LOG_US + 2_000_000, BEFORE_US + PERIOD_US, LOG_US + 1000 * PERIOD_US],
    ids=["after 1970", "from 1970 on", "over 1970", "before 1970", "long before"],
)
def test_shifted_log_gives_the_same_frames(shift_us: int, tmp_path: Path) -> None:
    """Of two logs so far apart, one in our days."""
    folders = [tmp_path / name for name in ("now", "then")]
    for folder in folders:
        folder.mkdir()
    shifts_us = (shift_us % PERIOD_US, shift_us)
    now, then = (replayed(us, folder) for us, folder in zip(shifts_us, folders, strict=True))
    assert len(now) > 1000
    assert sum(" 091#" in rest and rest.partition("#")[2][2] == "1" for _, rest in now) > 100  # Valid
    assert then == now
