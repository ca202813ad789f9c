"""A Story made of columns, without a log: as long, as wide and as eventful as a test needs."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrcd.config.config import load_packaged
from wrcd.core.causes import Cause, Validity
from wrcd.core.vocabulary import CONFIDENCES, SURFACES
from wrcd.logs.story_records import (
    AdhesionRecord,
    BusStatistics,
    Detail,
    Event,
    Fall,
    Finding,
    HealthRecord,
    MessageStatistics,
    Series,
    Story,
    StoryAxle,
    TruthRecord,
)

BEGIN_US = 1_700_000_000_000_000
HALF = np.array([np.nan, *(w if np.isfinite(w) else np.nan for w, _ in CONFIDENCES)], dtype=np.float32)
STATES = (
    (0, Cause.WARMING_UP),
    (1, Cause.NONE),
    (2, Cause.INPUT_STALE),
    (2, Cause.CONTRADICTION),
    (0, Cause.STANDSTILL),
)
VALIDITIES = (Validity.NOT_AVAILABLE, Validity.VALID, Validity.DEGRADED)


def synthetic(seconds: float = 60.0, axles: int = 1, seed: int = 1, name: str = "run.log") -> Story:
    """A drive over patches of worse rail, with noise, stale inputs and a gap; the same for the same seed."""
    rng = np.random.default_rng(seed)
    config = load_packaged(max(axles, 1))
    end_us = BEGIN_US + round(seconds * 1e6)
    speed_us = _stamps(rng, seconds, 20_000)
    speed = 25.0 + 3.0 * np.sin(np.arange(len(speed_us)) / 4000.0) + rng.normal(0.0, 0.01, len(speed_us))
    distance = np.cumsum(speed) * 0.02
    numbers = tuple(range(1, axles + 1))
    falls = tuple(
        Fall(a, BEGIN_US + round(t * 1e6), BEGIN_US + round((t + 0.4) * 1e6), 31.2, 5.1)
        for a in numbers
        for t in np.arange(9.3, seconds, max(60.0, seconds / 4.0))
    )
    ids = [(0x91 + i, f"Adhesion_A{i + 1}", "output", 50.0, 20.0) for i in range(axles)]
    return Story(
        log=Path(name), channel="can0", source="frames of the log", begin_us=BEGIN_US, end_us=end_us,
        axles=tuple(_axle(rng, a, seconds) for a in numbers),
        speed=Series(speed_us, {"speed_m_s": speed}), distance=Series(speed_us, {"distance_m": distance - distance[0]}),
        torque={a: _torque(rng, seconds) for a in numbers},
        status=_status(seconds), rejects=_rejects(rng, seconds), link=_link(seconds),
        bus=BusStatistics(
            tuple(
                MessageStatistics(k, n, r, int(hz * seconds), hz, 41.5, BEGIN_US + 5_000_000, cycle, 0)
                for k, n, r, hz, cycle in [*ids, (0x301, "", "other", 10.0, float("nan"))]
            ),
            BEGIN_US + 1_000_000 * np.arange(int(seconds)),
            rng.normal(1800.0, 4.0, int(seconds)).astype(np.float32),
            rng.normal(43.0, 0.2, int(seconds)).astype(np.float32), 500_000, np.zeros(0, dtype=np.int64),
        ),
        falls=falls,
        verdict=(
            Finding("warning", f"Adhesion fell to 5.1 % {len(falls)} times.", 0),
            Finding("good", "Valid for 93 % of the time.", 1, BEGIN_US, end_us),
            Finding("note", "The longest silence was 41 ms.", 1, BEGIN_US + 5_000_000, BEGIN_US + 5_041_000),
        ),
        warnings=(), config=config, versions={"wrcd": "0.2.0", "Python": "3.11"},
    )  # fmt: skip


def _stamps(rng: np.random.Generator, seconds: float, cycle_us: int) -> NDArray[np.int64]:
    n = max(2, round(seconds * 1e6 / cycle_us))
    stamps: NDArray[np.int64] = BEGIN_US + cycle_us * np.arange(n) + rng.integers(0, 300, n)
    return stamps


def _axle(rng: np.random.Generator, number: int, seconds: float) -> StoryAxle:
    time_us = _stamps(rng, seconds, 20_000)
    t = (time_us - BEGIN_US) / 1e6
    # a fall of 0.4 s at 9.3 s of every minute, for 6 s
    phase = t % 60.0
    truth = np.where((phase > 9.3) & (phase < 15.3), 5.0, 31.0) + 0.8 * np.sin(t / 7.0 + number)
    smooth = np.convolve(np.pad(truth, (20, 0), mode="edge"), np.ones(20) / 20.0, mode="full")[20 : 20 + len(t)]
    available = (smooth * (1.0 + 0.02 * np.cumsum(rng.normal(0.0, 0.05, len(t))) % 0.1)).astype(np.float32)
    used = (available * 0.6 + rng.normal(0.0, 0.05, len(t))).astype(np.float32)
    events = _events(rng, number, time_us)
    place = np.searchsorted([e.begin_us for e in events], time_us, side="right") - 1
    validity = np.array([VALIDITIES.index(e.validity) for e in events], dtype=np.int8)[place]
    cause = np.array([int(e.cause) for e in events], dtype=np.int8)[place]
    available[validity == 0] = np.nan
    confidence = np.where(validity == 1, np.where(available > 20.0, 4, 2), 0).astype(np.int8)
    half = HALF[confidence]
    surface = np.zeros(len(t), dtype=np.int8)
    for i, (least, _) in reversed(list(enumerate(SURFACES))):
        surface[available >= least] = i + 1
    contact = np.where(validity == 0, 0, np.where(used > 0.61 * available, 2, 1)).astype(np.int8)
    keep = ~((t > 22.0) & (t < 23.0))  # a second without frames
    low, high = (available - half).clip(0.0), available + half
    age = rng.integers(3, 9, len(t)).astype(np.float32)
    adhesion = AdhesionRecord(
        time_us[keep], validity[keep], available[keep], used[keep], low[keep], high[keep], confidence[keep],
        contact[keep], surface[keep], age[keep],
    )  # fmt: skip
    every = slice(None, None, 5)
    residual = np.round((rng.normal(0.0, 0.6, (len(t[every]), 4)) + [6.0, 3.0, 0.0, -2.0]) / 0.4) * 0.4
    residual[truth[every] < 10.0] += [-9.0, 0.0, 3.0, 6.0]
    winner = residual.argmin(axis=1).astype(np.int8) + 1
    winner[validity[every] == 0] = 0
    detail = Detail(
        time_us[every], residual.astype(np.float32), winner, (winner * 10).astype(np.int16), cause[every],
        np.column_stack([cause[every] == int(Cause.INPUT_STALE), *[np.zeros(len(winner), dtype=bool)] * 3]),
    )  # fmt: skip
    stale = cause[every] == int(Cause.INPUT_STALE)
    reach = np.full((len(winner), 4), 255, dtype=np.uint8)
    reach[stale, 0] = 254
    refused = np.zeros((len(winner), 4), dtype=np.int8)
    refused[stale, 0] = 3
    nothing = np.zeros(len(winner), dtype=bool)
    health = HealthRecord(time_us[every] + 400, reach, refused, np.ones(len(winner), dtype=np.int8), nothing, nothing)
    truth_us = time_us + 150
    return StoryAxle(
        number, adhesion, detail, health,
        TruthRecord(truth_us, truth.astype(np.float32), (used * 1.01).astype(np.float32)), events,
    )  # fmt: skip


def _events(rng: np.random.Generator, number: int, time_us: NDArray[np.int64]) -> tuple[Event, ...]:
    at = [int(time_us[0])]
    states = [STATES[0]]
    while at[-1] < time_us[-1]:
        valid = states[-1] == STATES[1]
        length = rng.exponential(20.0) if valid else rng.exponential(0.6) + 0.1
        at.append(at[-1] + round(1e6 * length))
        states.append(STATES[int(rng.integers(2, 5))] if valid else STATES[1])
    ends = [*at[1:], int(time_us[-1])]
    found = [
        Event(
            number,
            b,
            min(e, int(time_us[-1])),
            VALIDITIES[s[0]],
            s[1],
            "yaw rate YawRate.Rate 20.9 ms old" if s[1] else "",
        )
        for b, e, s in zip(at, ends, states, strict=True)
        if b < time_us[-1]
    ]
    return tuple(found)


def _torque(rng: np.random.Generator, seconds: float) -> Series:
    time_us = _stamps(rng, seconds, 10_000)
    return Series(
        time_us,
        {"torque_Nm": -8000.0 + 500.0 * np.sin(np.arange(len(time_us)) / 900.0) + rng.normal(0.0, 15.0, len(time_us))},
    )


def _status(seconds: float) -> Series:
    n = max(2, int(seconds))
    zero = np.zeros(n)
    return Series(
        BEGIN_US + 1_000_000 * np.arange(n),
        {"State": zero, "Overruns": zero, "RejectedFrames": zero, "LastReason": zero},
    )


def _rejects(rng: np.random.Generator, seconds: float) -> Series:
    n = max(2, int(seconds))
    crc = np.cumsum(rng.poisson(0.2, n)) % 16
    return Series(BEGIN_US + 1_000_000 * np.arange(n), {"RejectedCrc": crc.astype(float), "RejectedRange": np.zeros(n)})


def _link(seconds: float) -> Series:
    n = max(2, int(seconds))
    return Series(BEGIN_US + 1_000_000 * np.arange(n), {"LinkState": np.zeros(n), "ErrorFrames": np.zeros(n)})
