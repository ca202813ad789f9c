"""`sim-ecu drive`: the rig in real time, its loop open to whoever sends demands on the bus."""

import math
import time
from collections import deque
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import can

from sim_ecu.loop.bus_end import End, lost, on_bus
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.ride_figures import MIN_SLIDE_SPEED_M_S, judge
from sim_ecu.loop.rig import LOOP, TRUTH, WRCD, Rig, Step
from sim_ecu.loop.rig_messages import NONE_YET, SILENT, Silences, counted, times
from sim_ecu.play.encoder import SAMPLE_US, Sent
from sim_ecu.play.logs import check_format, open_logger
from sim_ecu.play.play import MAX_SAMPLES, PlayTally, message
from sim_ecu.play.train import PACKAGED
from wrcd.errors import Status

STATUS_US = 1_000_000
# So much lateness is caught up with. Of a computer that stood still for longer the controller has received nothing, and
# would find a train that went on without it for longer than a demand's time-out: the train's time waits.
MAX_LATE_US = 20_000
WORDS = {
    SILENT: "demand silent for 30 ms: traction ends, brakes apply as the driver asked",
    NONE_YET: "no demand yet: no traction, brakes apply as the driver asks",
}
WAITED = "this computer was busy: the train's time waited for {ms:.0f} ms"


class DriveSession:
    """Steps a rig as its samples fall due. step() does what is due, so that a loop may do other things between.

    Deadlines are absolute: a late sample does not move the next one, unless it is later than MAX_LATE_US. A demand acts
    in the whole of the sample in which it came, however late the computer is: as in lockstep, where it comes at once.
    """

    def __init__(
        self, scenario: DriveScenario, end: End, logger: can.Listener | None = None, truth: bool = True,
        channel: str = "can0",
    ) -> None:  # fmt: skip
        messages = [LOOP, WRCD, *([TRUTH] if truth else [])]
        self.rig, self.steps, self.tally = Rig(scenario, messages), list[Step](), PlayTally()
        self.silences = Silences([str(n) for n in scenario.axles], SAMPLE_US, WORDS, "demand ")
        self._scenario, self.end, self._logger, self._channel = scenario, end, logger, channel
        self._samples = round(scenario.train.duration_s * 1e6) // SAMPLE_US
        self._came: deque[tuple[int, int, bytes]] = deque()  # frames that no sample has begun after yet
        self._reported_us, self._wait_reported_us = 0, -STATUS_US
        self.waits = self.waited_us = 0
        end.begin()

    @property
    def over(self) -> bool:
        """Whether the scenario is, as in lockstep."""
        slow = bool(self.steps) and self.steps[-1].speed_m_s < self._scenario.stop_m_s
        return slow or len(self.steps) >= self._samples

    @property
    def _due_us(self) -> int:
        """When the next sample ends."""
        return self.rig.time_us + SAMPLE_US

    def wait_s(self) -> float:
        """How long until the next sample is due; 0 at the end."""
        return 0.0 if self.over else max(self._due_us - self.end.now_us, 0) * 1e-6

    def step(self) -> bool:
        """Make the samples that are due, and send their frames: MAX_SAMPLES at the most. False when it is over."""
        for _ in range(MAX_SAMPLES):
            if self.over:
                return False
            late_us = self.end.now_us - self._due_us
            if late_us < 0:
                return True
            self.tally.latest_us = max(self.tally.latest_us, late_us)
            self.tally.overruns += late_us > SAMPLE_US
            if late_us > MAX_LATE_US:
                self._wait(late_us)
            self._listen()
            step = self._advance()
            self._send(step.frames)
            self.steps.append(replace(step, frames=[]))
        return not self.over

    def _advance(self) -> Step:
        """The next sample, with the demands that came by its end."""
        rig = self.rig
        while self._came and self._came[0][0] <= self._due_us:
            stamp_us, can_id, data = self._came.popleft()
            rig.hear(can_id, data, stamp_us)
        silent = [
            None if h.stamp_us is None and rig.time_us < h.timeout_us else not h.fresh(rig.time_us)
            for h in rig.demands.values()
        ]
        step = rig.step()
        for what, axles in self.silences.look(step.due_us, silent).items():
            self.end.lines.event(step.due_us, f"axle{'s' * (len(axles) > 1)} {', '.join(axles)}: {what}")
        if self.end.lines.moves and step.due_us - self._reported_us >= STATUS_US:
            self._reported_us = step.due_us
            self.end.lines.status(self._status(step))
        return step

    def _wait(self, late_us: int) -> None:
        self.end.wait(late_us)
        self.waits += 1
        self.waited_us += late_us
        if self.end.now_us - self._wait_reported_us >= STATUS_US:
            self._wait_reported_us = self.end.now_us
            self.end.lines.event(self.end.now_us, WAITED.format(ms=late_us / 1000))

    def _listen(self) -> None:
        for stamp_us, f in self.end.receive():
            if f.can_id not in self.rig.ids:
                continue
            self._came.append((stamp_us, f.can_id, f.data))
            if self._logger is not None:
                self._logger.on_message_received(message(Sent(0, f.can_id, f.data), f.stamp_us, self._channel))

    def _send(self, frames: list[Sent]) -> None:
        wall_us = self.end.wall_us()
        for f in frames:
            sent = self.end.send(f.can_id, f.data, wall_us)
            self.tally.frames += sent
            self.tally.unsent += not sent
            if self._logger is not None and sent:
                self._logger.on_message_received(message(f, wall_us, self._channel))

    def _status(self, s: Step) -> str:
        worst = max(s.slip_m_s.tolist(), key=abs)
        silent = [n for n, s in self.silences.by_name.items() if s.now]
        return (
            f"{s.due_us * 1e-6:6.0f} s  {s.speed_m_s:5.1f} m/s  {s.distance_m:6.0f} m  slip {worst:+6.2f} m/s  "
            f"torque {s.torque_N_m.sum() / 1000:+6.1f} kN m"
            + (f"  demand silent: axle {', '.join(silent)}" if silent else "")
        )


@dataclass(frozen=True, slots=True)
class DriveResult:
    """What a drive came to."""

    steps: list[Step]
    counts: dict[str, Any]
    status: Status


def drive_on_bus(
    scenario: DriveScenario, interface: str, channel: str, log: Path | None = None, truth: bool = True
) -> DriveResult:
    """Until the scenario is over, or SIGTERM or Ctrl-C comes."""
    if log is not None:
        check_format(log, scenario.train, PACKAGED)
    warm_up = Rig(scenario)
    warm_up.step()  # what is compiled or read at first use is there before the time runs, and frames come
    with (
        on_bus(interface, channel, warm_up.ids, confirm=False) as (end, signalled),
        nullcontext() if log is None else open_logger(log) as logger,
    ):
        end.lines.event(0, f"{scenario.train.name} on {interface} {channel}: {scenario.train.duration_s:g} s at most")
        drive = DriveSession(scenario, end, logger, truth, channel)
        while not signalled() and drive.step():
            time.sleep(drive.wait_s())
        end.lines.end()
        return DriveResult(drive.steps, counts(drive), Status.DONE if drive.over else Status.STOPPED)


def counts(drive: DriveSession) -> dict[str, Any]:
    """What happened on the bus, for a document."""
    end, tally = drive.end, drive.tally
    messages = drive.rig.demands.values()
    demands = {
        int(n): silence.counts() | {"rejected": h.rejected}
        for (n, silence), h in zip(drive.silences.by_name.items(), messages, strict=True)
    }
    return {
        "demand": demands, "frames": tally.frames, "unsent": tally.unsent, "overruns": tally.overruns,
        "latest_ms": round(tally.latest_us / 1000, 1), "waits": drive.waits,
        "waited_s": round(drive.waited_us * 1e-6, 3), "bus": end.counts(),
    }  # fmt: skip


def summary(scenario: DriveScenario, ride: DriveResult) -> list[str]:
    """Return lines for a person."""
    train, counts = scenario.train, ride.counts
    title = f"{train.name}: {train.title}"
    if not ride.steps:
        return [title, "  stopped before the first sample"]
    last, f = ride.steps[-1], judge(ride.steps, scenario)
    why = f"slower than {scenario.stop_m_s:g} m/s" if f.stopped else "the scenario is over"
    if ride.status is Status.STOPPED:
        why = f"stopped early, of {train.duration_s:g} s"
    waited = f"; its time waited {times(counts['waits'])}, {counts['waited_s']:.2f} s" if counts["waits"] else ""
    out = [
        title,
        f"  time      {last.due_us * 1e-6:.1f} s: {why}",
        f"  train     {last.speed_m_s:.1f} m/s after {last.distance_m:.0f} m",
        f"  demand    {f.seconds:.1f} s and {f.stop_m:.0f} m from when it came, impulse {f.impulse_kNs:.0f} kNs",
        f"  slip      {f.slides} slides above {MIN_SLIDE_SPEED_M_S:g} m/s, largest {f.max_slip_m_s:.2f} m/s, "
        f"beyond the rail's peak for {f.beyond_s:.2f} s, wheels locked for {f.locked_s:.2f} s",
        f"  wear      {f.slip_energy_kJ:.1f} kJ slip energy a wheel, {f.beyond_kJ:.1f} of them beyond the peak"
        + ("" if math.isnan(f.utilisation) else f"; {f.utilisation:.0%} of the available adhesion used"),
        *(f"  axle {n}    demand {_silences(d)}{counted(d['rejected'])}" for n, d in counts["demand"].items()),
        f"  bus       {counts['frames']} frames, {counts['unsent']} not sent{lost(counts['bus'])}",
        f"  rig       {counts['overruns']} overruns, latest {counts['latest_ms']:.1f} ms behind its deadline{waited}",
    ]
    if counts["waits"]:  # a controller on the bus has lived through another stop
        out.append(
            f"  computer  too slow, or busy: up to {counts['latest_ms'] / 1000:.2f} s behind real time, "
            f"{counts['waited_s']:.2f} s in all; repeat the run on an idle one before it is judged"
        )
    return out


def _silences(d: dict[str, Any]) -> str:
    if not d["heard"]:
        return "never came"
    if not d["silences"]:
        return "never silent"
    return f"silent {times(d['silences'])}, {d['silent_s']:.2f} s in all, {d['longest_s']:.2f} s the longest"


def document(scenario: DriveScenario, ride: DriveResult) -> dict[str, Any]:
    """The same as a document; a figure that there is not is None."""
    out: dict[str, Any] = {"scenario": scenario.train.name, "over": ride.status is Status.DONE}
    if ride.steps:
        last = ride.steps[-1]
        figures = asdict(judge(ride.steps, scenario))
        out |= {"seconds": last.due_us * 1e-6, "speed_m_s": last.speed_m_s, "distance_m": last.distance_m}
        out["figures"] = {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in figures.items()}
    return out | ride.counts
