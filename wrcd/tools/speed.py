"""`wrcd check --speed`: what the core costs on this computer, on frames made in memory. No bus, no rig."""

import gc
import statistics
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrcd.bus.frame import Frame
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import Report
from wrcd.tools.progress import Progress
from wrcd.tools.synthetic import GOOD_TRACK, ROUGH_TRACK, Synthetic

# Measured by this very command with the default design, ticks of 5 ms.
REFERENCE_CPU = "Intel Xeon (family 6, model 167), one of two shared virtual cores"
REFERENCE_DATE = "2026-11-22"
REFERENCE_US = {1: 207.0, 4: 306.0, 6: 364.0, 8: 394.0}  # axles: microseconds a tick

BUDGET_S = 8.0  # of the whole command: less than ten seconds with the start
BLOCK_S = 1.0  # of the core's own time: every cycle of outgoing frames comes once
MIN_BLOCKS = 3


@dataclass(frozen=True, slots=True)
class Speed:
    """Microseconds a tick: of processor time, the median of the blocks' means, and the same on a rough track; of real
    time, the longest single tick, with whatever else the computer did meanwhile.

    valid and estimating are numbers of axles: those whose newest Adhesion frame is Valid, and those with an estimate.
    """

    axles: int
    tick_s: float
    blocks: int
    tick_us: float
    rough_us: float
    largest_us: float
    estimating: tuple[int, ...]
    valid: tuple[int, ...]

    @property
    def share(self) -> float:
        """Of one core at the configured tick."""
        return self.tick_us / (1e6 * self.tick_s)

    @property
    def ratio(self) -> float:
        """How many times as long as on the reference machine, with as many axles."""
        return self.tick_us / reference_us(self.axles)


def reference_us(axles: int) -> float:
    """Microseconds a tick on the reference machine; linear between the numbers of axles that were measured."""
    return float(np.interp(axles, list(REFERENCE_US), list(REFERENCE_US.values())))


def measure(config: Config, progress: Progress | None = None) -> Speed:
    """Feed cores for BUDGET_S of this computer's time: three quarters of it a good track, the rest a rough one."""
    progress = progress or Progress()
    usual = _run(config, GOOD_TRACK, 0.75 * BUDGET_S, progress)
    rough = _run(config, ROUGH_TRACK, 0.25 * BUDGET_S, progress)
    progress.end()
    validity = {a.number: report.validity for a, report in zip(config.axles, usual.reports, strict=True)}
    return Speed(
        axles=len(config.axles),
        tick_s=config.design.tick_s,
        blocks=len(usual.means_us),
        tick_us=statistics.median(usual.means_us),
        rough_us=statistics.median(rough.means_us),
        largest_us=1e-3 * max(usual.longest_ns, rough.longest_ns),
        estimating=tuple(a for a, v in validity.items() if v is not Validity.NOT_AVAILABLE),
        valid=tuple(a for a, v in validity.items() if v is Validity.VALID),
    )


@dataclass(slots=True)
class _Run:
    """Mean of each block, the longest tick in real time, and the newest slot's reports."""

    means_us: list[float]
    longest_ns: int
    reports: list[Report]


def _run(config: Config, roughness: float, budget_s: float, progress: Progress) -> _Run:
    """Feed a core of its own, at least MIN_BLOCKS blocks after its window is full.

    Frames are made before a block begins: only what the core does with them is timed.
    """
    d = config.design
    core, source = Core(config), Synthetic(config, roughness)
    block = max(1, round(BLOCK_S / d.tick_s))
    begin = time.perf_counter()
    for frames in source.ticks(round(d.longest_s / d.tick_s) + block):
        for frame in frames:
            core.feed(frame)
    gc.collect()
    gc.freeze()  # as the daemon does when it is ready
    out = _Run([], 0, [])
    try:
        while len(out.means_us) < MIN_BLOCKS or time.perf_counter() - begin < budget_s:
            progress.at("speed", min((time.perf_counter() - begin) / budget_s, 1.0))
            cpu_ns, longest_ns = _timed(core, list(source.ticks(block)))
            out.means_us.append(1e-3 * cpu_ns / block)
            out.longest_ns = max(out.longest_ns, longest_ns)
            out.reports = core.reports
    finally:
        gc.unfreeze()
    return out


def _timed(core: Core, ticks: list[list[Frame]]) -> tuple[int, int]:
    """Nanoseconds of this thread's processor time for all ticks, and of real time for the longest."""
    longest_ns = 0
    feed, clock = core.feed, time.perf_counter_ns
    begin_cpu_ns = time.thread_time_ns()
    for frames in ticks:
        begin_ns = clock()
        for frame in frames:
            feed(frame)
        longest_ns = max(longest_ns, clock() - begin_ns)
    return time.thread_time_ns() - begin_cpu_ns, longest_ns


def describe(s: Speed) -> list[str]:
    """Lines for a person."""
    return [
        f"speed          {s.tick_us:.0f} µs a tick of {1e3 * s.tick_s:g} ms ({s.axles} axle{'s' * (s.axles > 1)}, "
        f"median of {s.blocks} blocks of {BLOCK_S:g} s): {100 * s.share:.1f} % of a core",
        f"               {s.rough_us:.0f} µs a tick on a rough track",
        f"               longest tick {1e-3 * s.largest_us:.2f} ms, interruptions by others included",
        f"               {s.ratio:.2f} times the reference, {reference_us(s.axles):.0f} µs ({REFERENCE_CPU}, "
        f"{REFERENCE_DATE})",
        f"computer       {cpu()}",
        f"estimates      axles {_list(s.estimating)}; Valid: {_list(s.valid)}"
        + ("" if len(s.estimating) == s.axles else "; the others cost less than they will"),
    ]


def speed(config: Config) -> int:
    """Measure and print. 1 where an axle gave no estimate: then the figure lacks a part of the work."""
    s = measure(config, progress=Progress())
    print("\n".join(describe(s)))
    return 0 if len(s.estimating) == s.axles else 1


def _list(numbers: tuple[int, ...]) -> str:
    return ", ".join(map(str, numbers)) or "none"


def cpu() -> str:
    """The processor's name, as the kernel tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    # "model name" on x86, "Model" on most ARM boards
    names = (line.partition(":")[2].strip() for line in lines if line.lower().startswith(("model name", "model\t\t:")))
    return next((n for n in names if not n.isdigit()), "unknown processor")
