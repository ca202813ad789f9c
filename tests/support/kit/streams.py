"""Frames of a daemon, recorded or made, and what a bus does to them: loss, repeats, flipped bits, silence, others."""

import random
from collections.abc import Sequence
from dataclasses import replace

from tests.support.daemon_frames import GOOD, START_US, DaemonFrames
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.writers import Value
from wrcd.core.configuration import Config


def counted(config: Config, number: int, seed: int) -> list[Frame]:
    """Sound frames of the first axle, of two senders who take turns at random, stop, and start anew."""
    rng, frames, out = random.Random(seed), DaemonFrames(config), []
    cycle_us, counters, now_us = config.axles[0].adhesion.cycle_us, [0, 7], 0
    share = 0.5
    for _ in range(number):
        share = rng.choice((0.0, 0.05, 0.2, 0.5)) if rng.random() < 0.05 else share
        sender = int(rng.random() < share)
        counters[sender] += rng.choice((1, 1, 1, 1, 1, 2, 3)) if rng.random() < 0.98 else rng.randrange(15)
        now_us += round(rng.uniform(0.3, 1.0) * cycle_us) if rng.random() < 0.995 else 10 * cycle_us
        values: dict[str, Value] = {**GOOD, "MuUsed": float(sender)}
        out.append(replace(frames.adhesion(cycle_us * counters[sender], values), stamp_us=START_US + now_us))
    return out


def disturbed(frames: Sequence[Frame], seed: int) -> list[Frame]:
    """The frames after a bad bus. Time does not go back."""
    rng, out = random.Random(seed), []
    lost, earlier = 0, frames[0]
    for number, f in enumerate(frames):
        fate = rng.random()
        lost -= lost > 0
        if fate < 0.004:
            lost = rng.randrange(1, 40)
        if lost or fate < 0.04:
            continue
        if fate < 0.07:  # flipped bits
            data = bytearray(f.data)
            for _ in range(rng.randrange(1, 4)):
                bit = rng.randrange(8 * len(data))
                data[bit // 8] ^= 1 << bit % 8
            f = replace(f, data=bytes(data))
        elif fate < 0.09:  # a repeat, or a frame of before
            out.append(replace(rng.choice((f, earlier)), stamp_us=f.stamp_us))
        elif fate < 0.11:  # of another kind, length or id
            out.append(
                rng.choice(
                    (
                        replace(f, fd=True), replace(f, remote=True), replace(f, extended=not f.extended),
                        replace(f, data=f.data[:-1]), replace(f, data=f.data + b"\0"), replace(f, data=b""),
                        replace(f, error=True), replace(frames[number - 1], can_id=f.can_id, stamp_us=f.stamp_us),
                    )
                )
            )  # fmt: skip
        elif fate < 0.12:
            earlier = f
        out.append(f)
    return _with_second_sender(out, frames, rng)


def _with_second_sender(out: list[Frame], frames: Sequence[Frame], rng: random.Random) -> list[Frame]:
    """For some seconds somebody sends frames of half a minute before, too."""
    end_us = frames[-1].stamp_us - START_US
    for _ in range(3):
        begin = START_US + rng.randrange(end_us)
        span, shift = rng.randrange(50_000, 2_000_000), rng.randrange(1, 14) * 20_000 + 7_000
        out += [replace(f, stamp_us=f.stamp_us + shift) for f in frames if begin <= f.stamp_us < begin + span]
    return sorted(out, key=lambda f: f.stamp_us)


def lines(config: Config, frames: Sequence[Frame]) -> list[tuple[int, str]]:
    """For feed.c: the axle that is asked for, and the line."""
    axles = {(m, e): a for a, m, e in _ids(config)}
    numbers = [a.number for a in config.axles]
    out = []
    for place, f in enumerate(frames):
        axle = axles.get((f.can_id, f.extended), numbers[place % len(numbers)])
        flags = f.extended | f.fd << 1 | f.remote << 2 | f.error << 3
        out.append((axle, f"{f.stamp_us} {axle} {f.can_id:x} {flags} {f.data.hex() or '-'}"))
    return out


def _ids(config: Config) -> list[tuple[int, int, bool]]:
    found = [(a.number, find_message(config.database, a.adhesion.message)) for a in config.axles]
    return [(number, m.frame_id, m.is_extended_frame) for number, m in found]
