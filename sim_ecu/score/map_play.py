"""A passage over a place: rig -> frames -> the daemon's core, its axles on one rail -> blocks of track."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.contact import peak
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import LARGE_CHUNK, Player
from sim_ecu.play.train import PACKAGED, placed
from sim_ecu.score.low_rail import BLOCK_M, LAG_S, AxleWords, TrackBlocks, blocks_of
from sim_ecu.score.suites.map_passages import MapPlace, PassageRun
from wrcd.bus.batch import FrameBatch
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.vocabulary import CONFIDENCES, VALID, words_of

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
HALF_WIDTHS_PP = np.array([np.nan, *(half_width for half_width, _ in CONFIDENCES)])  # by place of the word
LEAST_INSIDE = 0.5  # share of a block


@dataclass(frozen=True, slots=True)
class Passage:
    """What came of a passage, (b,) each: what the train says of the blocks that it has wholly run over; at least half
    of which lies on the place's film or stretch, and which are clear of it and its edges; where a wheel slid on it, and
    the share of its adhesion that was in use (NaN beside it)."""

    suite: str
    place: MapPlace
    effort: str
    driven: bool
    blocks: TrackBlocks
    inside: BoolArray
    clear: BoolArray
    slid: BoolArray
    used_share: FloatArray


def play_passage(run: PassageRun, config: Config) -> Passage:
    """Play a passage through a core that knows where the axles stand: on one rail, whatever each finds there."""
    played, v = run.scenario, run.speed_m_s
    alike = replace(played, axles=tuple(replace(a, rail=played.axles[0].rail) for a in played.axles))
    core, numbers = Core(placed(config, alike)), [a.number for a in played.axles]
    encoder, player = PACKAGED.encoder(numbers, truth=False), Player(played, truth=False, chunk=LARGE_CHUNK)
    reports, times_s, truth = [], [], []
    for due_us, speed, readings in player.measured_chunks():
        frames = encoder.frames_of(due_us, speed, readings)
        frames["due_us"] += LOG_START_US
        reports.append(core.feed(FrameBatch(frames.tobytes())).reports)
        times_s.append(due_us * 1e-6)
        truth.append(readings[..., 3:])
    said, ahead_m = np.concatenate(reports).reshape(-1, len(numbers)), np.array([a.position_m for a in played.axles])
    mu = np.where(said["validity"] == words_of("adhesion", "Validity").index(VALID), said["mu_available_pct"], np.nan)
    upper = mu + HALF_WIDTHS_PP[said["confidence"]]
    at_m = ((said["time_us"] - LOG_START_US) * 1e-6 - LAG_S) * v + ahead_m
    blocks = blocks_of([AxleWords(*columns) for columns in zip(at_m.T, mu.T, upper.T, strict=True)])
    whole = (blocks.number > 0) & ((blocks.number + 1) * BLOCK_M <= at_m[-1].min())
    wheels_m = np.concatenate(times_s)[:, None] * v + ahead_m
    return _judged(run, TrackBlocks(*(column[whole] for column in blocks)), wheels_m, np.concatenate(truth))


def _judged(run: PassageRun, blocks: TrackBlocks, wheels_m: FloatArray, truth: FloatArray) -> Passage:
    """Lay the truth beside the blocks: MuAvailable and MuUsed (%) and creep of each sample and axle, (n, axles, 3)."""
    place, v = run.place, run.speed_m_s
    begin, end = place.film_m
    from_m, to_m = blocks.number * BLOCK_M, (blocks.number + 1) * BLOCK_M
    available, used, creep = np.moveaxis(truth, 2, 0)
    on_film = (wheels_m >= begin + place.edge_m) & (wheels_m < end)
    slides = on_film & (
        np.abs(creep) >= [peak(v, run.scenario.wheelset.contact, *curve.row())[0] for curve in run.film]
    )
    block = np.floor(wheels_m / BLOCK_M).astype(np.int64)
    share = [np.median((used / available)[on_film & (block == n)]) if (block[on_film] == n).any() else np.nan
             for n in blocks.number]  # fmt: skip
    inside = np.minimum(to_m, end) - np.maximum(from_m, begin + place.edge_m) >= LEAST_INSIDE * BLOCK_M
    clear = (to_m <= begin) | (from_m >= end + place.edge_m)
    slid = np.isin(blocks.number, block[slides])
    return Passage(run.suite, place, run.effort, run.driven, blocks, inside, clear, slid, np.array(share))
