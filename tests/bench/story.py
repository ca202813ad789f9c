"""A report of a long log, and its parts, in seconds and megabytes: `python -m tests.bench.story [--minutes 60]`.

A minute of four axles is played and replayed once; the log repeats it with shifted stamps, rig's frames, truth and
wrcd's own. E2E counters jump at the seams, as they do where an axle is switched off. Figures, no verdicts.
"""

import argparse
import statistics
import sys
import tempfile
from pathlib import Path

from sim_ecu.play.play import play_to_log
from sim_ecu.play.scenario import read_scenario
from tests.bench.core import ROOT
from tests.bench.replay import measured
from wrcd.cli.main import main as wrcd
from wrcd.config.settings import parse_toml

SCENARIO = """
duration_s = 60.0
speed_m_s = 25.0
axles = [1, 2, 3, 4]
[[rail]]
curve = "A"
[[rail]]
from_m = 500.0
curve = "F"
[[rail]]
from_m = 800.0
curve = "A"
[drive]
creep_of_peak = [[0.0, 0.0], [1.0, 1.0]]
[axle.2]
rail = [{ curve = "C" }]
[axle.3]
rail = [{ curve = "E" }]
drive = { utilisation = [[0.0, 0.0], [1.0, 0.6]] }
"""


def write_log(log: Path, minutes: int) -> int:
    """Write the log, and return how many frames it has."""
    rig, sent = log.with_name("rig.log"), log.with_name("sent.log")
    play_to_log(read_scenario(parse_toml(SCENARIO, "bench"), "bench"), rig)
    wrcd(["replay", str(rig), "-o", str(sent)])
    lines = sorted((x for part in (rig, sent) for x in part.read_text().splitlines(keepends=True)), key=_stamp)
    seconds = [int(x[1:11]) for x in lines]
    rest = [x[11:] for x in lines]
    with log.open("w") as file:
        for minute in range(minutes):
            file.writelines(f"({s + 60 * minute:010d}{x}" for s, x in zip(seconds, rest, strict=True))
    return minutes * len(lines)


def _stamp(line: str) -> str:
    return line[1:18]


def main() -> int:
    """Entry point. Always 0."""
    p = argparse.ArgumentParser(prog="python -m tests.bench.story", description=__doc__)
    p.add_argument("--minutes", type=int, default=60)
    p.add_argument("--times", type=int, default=3)
    args = p.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = folder / "long.log"
        frames = write_log(log, args.minutes)
        print(f"{args.minutes} minutes, four axles: {frames} frames, {log.stat().st_size / 1e6:.0f} MB")
        dbc = str(ROOT / "dbc/sim_ecu.dbc")
        for command in (
            ["report", str(log), "-o", str(folder / "report.html"), "--dbc", dbc],
            ["report", str(log), "--png", str(folder / "long.png"), "--dbc", dbc, "--force"],
            ["why", str(log), "30", "--dbc", dbc],
        ):
            runs = [measured(command, folder) for _ in range(args.times)]
            told = ", ".join(
                f"{statistics.median(r[key] for r in runs):.1f} {unit} "
                f"({min(r[key] for r in runs):.1f} … {max(r[key] for r in runs):.1f})"
                for key, unit in (("wall_s", "s"), ("cpu_s", "s of processor"), ("most_mb", "MB"))
            )
            print(f"wrcd {command[0]:<7} {told}")
        print(f"report.html   {(folder / 'report.html').stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
