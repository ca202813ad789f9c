"""What the map of low rail finds, and how often it calls good rail low."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from sim_ecu.reporting.values import Figure
from sim_ecu.score.low_rail import BLOCK_M, RULE, LowRule, TrackBlocks, is_low, is_low_by_most, rule_for
from sim_ecu.score.map_play import Passage
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.suites.map_passages import EFFORTS, FILM, IN_WORLDS, PLACE_KINDS
from sim_ecu.score.suites.worlds import AS_TRAINED, UNSEEN

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
PER_100_KM = 100e3 / BLOCK_M
FAMILIES = (AS_TRAINED, UNSEEN)
ONE, THREE, AS_DRIVEN = "one passage", "three passages", "as driven"
USES = {"less than 40 %": (0.0, 0.4), "40 to 60 %": (0.4, 0.6), "60 to 85 %": (0.6, math.inf)}
LENGTHS = {"100 to 200 m": (0.0, 200.0), "200 to 300 m": (200.0, 300.0), "300 to 400 m": (300.0, math.inf)}
RAILS = {"3 to 4.5 %": (0.0, 4.5), "4.5 to 6 %": (4.5, 6.0), "6 to 8 %": (6.0, math.inf)}
SWEPT = np.exp(np.linspace(np.log(0.3), np.log(3.0), 50)).tolist()  # times both numbers of the rule, for the curves


@dataclass(frozen=True)
class MapBlocks:
    """The blocks of all passages, (n,) each, in their order."""

    passages: Sequence[Passage]

    @cached_property
    def said(self) -> TrackBlocks:
        """What the trains say of them."""
        return TrackBlocks(*(np.concatenate(column) for column in zip(*(p.blocks for p in self.passages), strict=True)))

    def own(self, name: str) -> NDArray[Any]:
        """A column of the passages."""
        return np.concatenate([getattr(p, name) for p in self.passages])

    def each(self, values: Sequence[Any]) -> NDArray[Any]:
        """A value of each passage, for all of its blocks."""
        return np.repeat(np.array(values), [len(p.blocks.number) for p in self.passages], axis=0)

    def place(self, name: str) -> NDArray[Any]:
        """A value of each passage's place."""
        return self.each([getattr(p.place, name) for p in self.passages])


def map_figures(passages: Sequence[Passage]) -> dict[str, Any]:
    """Return the rules, the rows of the table with each family's figures, and by family false alarms and what is found,
    in one passage and in three, as both numbers of the rules go up."""
    b = MapBlocks(passages)
    place, slid, family = b.place("number"), b.own("slid"), b.place("family")
    low: BoolArray = b.own("inside") & b.place("has_film")
    good: BoolArray = b.own("clear") | ~b.place("has_film")
    ordinary: BoolArray = ~b.each([p.driven for p in passages])
    of_film: BoolArray = b.place("kind") == FILM.name
    found, film = is_low(b.said), low & ordinary & of_film
    sets = {ONE: ("", film, good), **dict(_parts(b, low, good, film))}
    driven, none = low & of_film & ~ordinary, np.zeros(len(low), bool)
    sets |= {AS_DRIVEN: ("", driven, good & ~ordinary), f"{AS_DRIVEN}, no wheel slid": ("", driven & ~slid, none)}
    rows = {
        name: {"by": by} | {f: _found(found, slid, low & (family == f), good & (family == f), place) for f in FAMILIES}
        for name, (by, low, good) in sets.items()
    }
    again, of_three = _same_block(place * 1000 + b.said.number, ordinary), rule_for(FILM.ordinary)
    first = again[:, 0]
    most = is_low_by_most(is_low(b.said, of_three)[again].sum(axis=1), FILM.ordinary)
    any_slid: BoolArray = np.any(slid[again], axis=1)
    rows[THREE] = {"by": ""} | {
        f: _found(most, any_slid, (film & (family == f))[first], (good & (family == f))[first], place[first])
        for f in FAMILIES
    }  # fmt: skip
    curves: dict[str, list[list[float]]] = {f"{name}, {f}": [] for f in FAMILIES for name in (ONE, THREE)}
    for times in SWEPT:
        once, each = (is_low(b.said, LowRule(*(times * number for number in rule))) for rule in (RULE, of_three))
        in_most = is_low_by_most(each[again].sum(axis=1), FILM.ordinary)
        for f in FAMILIES:
            for name, says, at in ((ONE, once, slice(None)), (THREE, in_most, first)):
                share, alarms = (says[(mask & (family == f))[at]] for mask in (film, good))
                curves[f"{name}, {f}"].append([PER_100_KM * _mean(alarms), _mean(share)])
    return {
        "rule": RULE._asdict(), "rule_of_three": of_three._asdict(), "passages": len(passages),
        "places": len(np.unique(place)), "good_km": float(good.sum() * BLOCK_M / 1000),
        "rows": {n: rows.pop(n) for n in (ONE, THREE)} | rows, "curves": curves,
    }  # fmt: skip


def _mean(values: BoolArray) -> float:
    return float(np.mean(values)) if len(values) else math.nan


def _found(found: BoolArray, slid: BoolArray, low: BoolArray, good: BoolArray, place: IntArray) -> dict[str, Figure]:
    shares = {"found": found, "slides": slid, "either": found | slid}
    return {name: bootstrap.share(of[low], place[low]) for name, of in shares.items()} | {
        "alarms": false_alarms(found[good], place[good])
    }


def false_alarms(called: BoolArray, place: IntArray) -> Figure:
    """Return how many blocks of good rail are called low, per 100 km of it. Those of one place are alike, so the 90 %
    interval is Poisson's, of the places that have one."""
    if not len(called):
        return bootstrap.NOTHING
    value, having = PER_100_KM * _mean(called), len(np.unique(place[called]))
    each = value / having if having else PER_100_KM / len(called)
    low = each * gammaincinv(having, bootstrap.ENDS[0]) if having else 0.0
    high = each * gammaincinv(having + 1, bootstrap.ENDS[1])
    return Figure(value, float(low), float(high), len(np.unique(place)), len(called))


def _same_block(key: IntArray, ordinary: BoolArray) -> NDArray[np.int64]:
    """Return the places (m, FILM.ordinary) of blocks that every ordinary passage of a place has."""
    at = np.flatnonzero(ordinary)
    at = at[np.argsort(key[at], kind="stable")]
    begins = np.flatnonzero(np.diff(key[at], prepend=-1))
    times = np.diff(begins, append=len(at))
    same: IntArray = at[begins[times == FILM.ordinary][:, None] + np.arange(FILM.ordinary)]
    return same


def _parts(
    b: MapBlocks, low: BoolArray, good: BoolArray, film: BoolArray
) -> Iterator[tuple[str, tuple[str, BoolArray, BoolArray]]]:
    """Yield the rows of one ordinary passage: name, what they are sorted by, blocks of low and of good rail."""
    kind, world, inside = b.place("kind"), b.place("world"), b.own("inside")
    effort, begins, ends = b.each([p.effort for p in b.passages]), *np.transpose(b.place("film_m"))
    none = np.zeros(len(low), bool)
    for k in PLACE_KINDS[1:]:
        yield k.name, ("rail", low & (kind == k.name), good & (kind == k.name) & (inside | (k.low_pct is not None)))
    for name in IN_WORLDS:
        yield name, ("world", film & (world == name), good & (world == name))
    for name in EFFORTS:
        yield name, ("effort", film & (effort == name), good & (effort == name))
    for by, values, bins in (
        ("use of what the film bears", b.own("used_share"), USES), ("length of the film", ends - begins, LENGTHS),
        ("adhesion of the film", b.place("low_pct"), RAILS),
    ):  # fmt: skip
        for name, (least, most) in bins.items():
            yield f"{by}: {name}", (by, film & (values >= least) & (values < most), none)
