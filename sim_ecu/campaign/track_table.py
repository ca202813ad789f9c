"""Low rail by kilometre, from the passages of any trains: the logs' places, a table of blocks, a picture."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sim_ecu.campaign.kinds.log import DIRECTIONS, KILOMETRE
from sim_ecu.score.low_rail import BLOCK_M, TrackBlocks, is_low, is_low_by_most, rule_for
from wrcd.errors import InputError

HEAD = ("log", "from_km", "direction")
HINT = f"{','.join(HEAD)}, then for each log its path below --logs, the kilometre of its first speed, and up or down"
LOW, GOOD = "#D55E00", "0.6"


def places_of(file: Path) -> dict[str, dict[str, Any]]:
    """Read where each log begins and which way its train runs. Raises InputError with file and line."""
    try:
        lines = list(csv.reader(file.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"cannot be read: {e}", file=file, key="--from-km") from None
    if not lines or tuple(lines[0]) != HEAD:
        raise InputError(f"does not begin with {','.join(HEAD)}", file=file, line=1, hint=HINT)
    found: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(lines[1:], 2):
        try:
            log, km, direction = line
            from_km = float(km)
        except ValueError:
            raise InputError(f"is {','.join(line)!r}", file=file, line=number, hint=HINT) from None
        if direction not in DIRECTIONS or not np.isfinite(from_km):
            raise InputError(f"is {','.join(line)!r}", file=file, line=number, hint=HINT)
        if log in found:
            raise InputError(f"{log} stands there twice", file=file, line=number, hint="a log begins at one place")
        found[log] = {"from_km": from_km, "direction": direction}
    return found


def by_block(passages: Sequence[tuple[str, Sequence[Sequence[float]]]]) -> pd.DataFrame:
    """Return a row for each block of which a train has enough frames, and of the rest of its passage, by kilometre.

    passages: train, and its rows of TrackBlocks.
    """
    said, of = [(train, *row) for train, rows in passages for row in rows], TrackBlocks._fields
    every, found = pd.DataFrame(said, columns=["train", *of]).astype(dict.fromkeys(of, float)), []
    for number, group in every.dropna(subset=["available_pct", "rest_pct"]).groupby("number"):
        n, blocks = len(group), TrackBlocks(*(group[name].to_numpy() for name in of))
        low = int(is_low(blocks, rule_for(n)).sum())
        km, trains = round(float(str(number)) * BLOCK_M / KILOMETRE, 1), group["train"].nunique()
        found.append((km, n, trains, low, float(np.median(blocks.available_pct)), bool(is_low_by_most(low, n))))
    columns = {"km": float, "passages": int, "trains": int, "called_low": int, "available_pct": float, "is_low": bool}
    return pd.DataFrame(found, columns=list(columns)).astype(columns)


def stretches(table: pd.DataFrame) -> Iterator[str]:
    """Yield a line for each stretch of low blocks."""
    low = table[table["is_low"]]
    for _, part in low.groupby((low["km"].diff() > 1.5 * BLOCK_M / KILOMETRE).cumsum()):
        worst = part.loc[part["called_low"].idxmax()]
        yield (
            f"low rail: km {part['km'].iloc[0]:.1f} to {part['km'].iloc[-1] + BLOCK_M / KILOMETRE:.1f}: "
            f"{worst['called_low']} of {worst['passages']} passages, {worst['trains']} trains, "
            f"adhesion {part['available_pct'].median():.0f} %"
        )


def draw_track(table: pd.DataFrame, file: Path) -> None:
    """Adhesion by kilometre, and how many passages there are and call a block low."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    adhesion, passages = figure.subplots(2, sharex=True, height_ratios=(2, 1))
    km, width, is_low_here = table["km"], BLOCK_M / KILOMETRE, table["is_low"]
    for colour, at, label in ((GOOD, ~is_low_here, "not low"), (LOW, is_low_here, "low in most passages")):
        adhesion.bar(km[at], table["available_pct"][at], width, align="edge", color=colour, label=label)
    passages.bar(km, table["passages"], width, align="edge", color=GOOD)
    passages.bar(km, table["called_low"], width, align="edge", color=LOW)
    adhesion.set(ylabel="adhesion, %")
    adhesion.legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize="small")
    passages.set(ylabel="passages", xlabel="km of the track")
    passages.yaxis.get_major_locator().set_params(integer=True)
    figure.savefig(file, format="png", dpi=120)


def place_of(places: Mapping[str, Mapping[str, Any]], log: str, file: Path) -> Mapping[str, Any]:
    """Return a log's place. Raises InputError for one that the file does not name."""
    if log not in places:
        raise InputError(f"has no line for {log}", file=file, key="--from-km", hint=HINT)
    return places[log]
