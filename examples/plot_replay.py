"""Draw the CSV of a replay: adhesion with its 90 % interval, adhesion in use, and why it is not Valid.

    .venv/bin/wrcd replay tests/golden/leaf-film.log --csv leaf-film.csv
    .venv/bin/python examples/plot_replay.py leaf-film.csv leaf-film.png

writes leaf-film.png and prints how much of the time each cause took:

    the window is not full yet: 1.0 s
    too few measurements in the window, or of too little track: 0.4 s
    an input is silent or refused: 0.0 s
"""

import csv
import math
import sys
from collections import Counter
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt

SLOT_S = 0.02


def plot(table: Path, picture: Path, axle: int = 1) -> dict[str, float]:
    """Draw one axle of a CSV. Returns the seconds for which each cause kept it from being Valid."""
    with table.open(encoding="utf-8") as file:
        rows = [r for r in csv.DictReader(file) if int(r["axle"]) == axle]
    start = float(rows[0]["time_s"])
    time = [float(r["time_s"]) - start for r in rows]
    used = [float(r["mu_used_pct"] or math.nan) for r in rows]
    mu, low, high = (
        [float(r[column] or math.nan) if r["validity"] == "Valid" else math.nan for r in rows]
        for column in ("mu_available_pct", "low_pct", "high_pct")
    )
    figure, axes = plt.subplots(figsize=(10, 4.5))
    axes.fill_between(time, used, color="0.85", label="in use")
    axes.fill_between(time, low, high, alpha=0.25, label="its 90 % interval")
    axes.plot(time, mu, label="available, where Valid")
    axes.set(xlabel="time, s", ylabel=f"axle {axle}: adhesion, %", ylim=(0, 55))
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right")
    figure.tight_layout()
    figure.savefig(picture, dpi=100)
    plt.close(figure)
    causes = Counter(r["cause"] for r in rows if r["cause"])
    return {cause: round(slots * SLOT_S, 2) for cause, slots in causes.most_common()}


if __name__ == "__main__":
    for why, seconds in plot(Path(sys.argv[1]), Path(sys.argv[2])).items():
        print(f"{why}: {seconds:.1f} s")
