"""Silence is no step of time: the core, the loop and a replay, live and from logs, agree on what comes after either."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1, ESTIMATES
from tests.support.core_state import state
from tests.support.scripted_link import ScriptedLink
from tests.support.sensor_simulator import SensorSimulator, until_ms, validities
from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.core.configuration import Config, RecorderConfig
from wrcd.core.core import Core
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.recorder import recorder
from wrcd.recorder.recorder import Recorder
from wrcd.service.loop import Daemon

SECOND = 1_000_000


def silent(sim: SensorSimulator, us: int) -> None:
    """Nothing comes, and a clock says so at every tick."""
    end = sim.t + us
    while sim.t < end:
        sim.t += 5_000
        sim.out += sim.core.advance(sim.t)


@pytest.mark.parametrize("seconds", [0.8, 1.005, 70.0])
def test_silence_is_no_time_step(config: Config, seconds: float) -> None:
    sim = SensorSimulator(config)
    sim.run(1500)
    before = len(sim.out)
    silent(sim, round(seconds * 1e6))
    frames = sim.adhesion(sim.out[before:])
    assert len(frames) == round(seconds * 50)
    assert frames[-1]["Validity"] == "NotAvailable"
    frames = sim.run(1500)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert until_ms(frames, "Valid") <= 1040
    assert sim.core.counts.time_steps == 0


def a_jump_of_speed(sim: SensorSimulator) -> None:
    """It is believed in a tick that is still open."""
    sim.speed = 40.0
    sim.run(5)
    for frame in sim.frames():
        sim.out += sim.core.feed(frame)


def counters_of_another(sim: SensorSimulator) -> None:
    sim.counter += 7
    sim.run(5)


def two_in_a_tick(sim: SensorSimulator) -> None:
    """One of them waits, as long as it may."""
    for k in range(13):
        sim.t -= 2_000 if k < 3 else 0
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)


BEFORE: dict[str, Callable[[SensorSimulator], object]] = {
    "nothing": lambda sim: None,
    "stuck": lambda sim: sim.during(200, frozen=True),
    "a jump of speed": a_jump_of_speed,
    "absurd": lambda sim: sim.during(60, spike=1_000_000),
    "counters of another": counters_of_another,
    "two in a tick": two_in_a_tick,
}


@pytest.mark.parametrize(
    ("before", "seconds"), [*((name, 1.005) for name in BEFORE), ("stuck", 59.0), ("absurd", 59.0)]
)
def test_silence_and_time_step_leave_the_same_state(config: Config, seconds: float, before: str) -> None:
    """To the last bit of the state, whatever was going on before."""
    sims = SensorSimulator(config), SensorSimulator(config)
    for sim in sims:
        sim.run(2000)
        BEFORE[before](sim)
    silence, step = sims
    silent(silence, round(seconds * 1e6))
    step.t = back_us = silence.t
    for sim in sims:
        sim.run(5)
        two_in_a_tick(sim)
        sim.run(2000)
    assert [sim.core.counts.time_steps for sim in sims] == [0, 1]
    after = [[o for o in sim.out if o.frame.stamp_us > back_us + 1_000] for sim in sims]
    made = [[o.frame for o in out if o.frame.can_id in ESTIMATES] for out in after]
    assert made[0] == made[1]
    assert validities(silence.adhesion(after[0])) == ["NotAvailable", "Valid"]
    one, other = (state(sim.core) for sim in sims)
    counted = {"core.time_steps", "core.ticks", "core.restarts"}
    assert {name for name in one if one[name] != other[name]} <= counted


class Live:
    """Simulator, loop and a bus whose every frame is logged, on clocks of the test's own."""

    def __init__(self, config: Config, recorder: Path | None = None) -> None:
        self.sim, self.link, self.lines = SensorSimulator(config), ScriptedLink(), list[Frame]()
        self.ahead_us = 0  # the wall clock, of the steady one
        kept = RecorderConfig(recorder, 60.0, 20, 200.0) if recorder else None
        self.recorder = Recorder(kept, self.sim.core, "vcan0", lambda _: None) if kept else None
        self.daemon = Daemon(
            self.sim.core, self.link, clock=self.now, steady=lambda: self.now() - self.ahead_us, recorder=self.recorder
        )

    def now(self) -> int:
        return self.sim.t + 1000

    def run(self, seconds: float, there: bool = True) -> None:
        """The loop turns; sensors are there or not."""
        for _ in range(round(seconds * 200)):
            frames = self.sim.frames() if there else []
            self.sim.t += 0 if there else 5_000
            self.put(frames)
            self.daemon.turn()

    def put(self, frames: list[Frame]) -> None:
        self.link.waiting += frames
        self.lines += frames

    def stall(self, seconds: float, held: int) -> None:
        """The loop stands still; of the sensors' frames the kernel holds the first so many ticks', the rest is lost."""
        for k in range(round(seconds * 200)):
            frames = self.sim.frames()
            if k < held:
                self.put(frames)
        self.daemon.turn()

    def step(self, seconds: float) -> None:
        self.sim.t += round(seconds * 1e6)
        self.ahead_us += round(seconds * 1e6)

    def logged(self, path: Path, own: bool) -> Path:
        """As candump would have it: what came, and with own what was sent, by their stamps."""
        lines = [*self.lines, *(replace(f, stamp_us=f.stamp_us + 1500) for f in self.link.sent if own)]
        lines.sort(key=lambda f: f.stamp_us)
        path.write_text("".join(format_line(f, "vcan0") + "\n" for f in lines))
        return path


def replayed(log: Path, out: Path) -> dict[tuple[int, int], bytes]:
    assert main(["replay", str(log), "-o", str(out)]) == 0
    return {(f.can_id, f.stamp_us): f.data for f, _ in read_log(out, Damage())}


def compared(live: Live, made: dict[tuple[int, int], bytes]) -> int:
    """Whether the estimates sent until the newest input are what was made; how many of them are Valid."""
    newest = max(f.stamp_us for f in live.lines)
    sent = {(f.can_id, f.stamp_us): f.data for f in live.link.sent if f.can_id in ESTIMATES and f.stamp_us <= newest}
    assert {key: made.get(key) for key in sent} == sent
    return sum(can_id == ADHESION_A1 and data[1] >> 4 == 1 for (can_id, _), data in sent.items())


@pytest.mark.parametrize("own", [False, True], ids=["sensors alone", "with what was sent"])
@pytest.mark.parametrize("seconds", [0.5, 1.0, 30.0])
def test_log_with_a_silence_replays_to_what_was_sent(config: Config, tmp_path: Path, seconds: float, own: bool) -> None:
    live = Live(config)
    live.run(2.0)
    live.run(seconds, there=False)
    live.run(2.0)
    made = replayed(live.logged(tmp_path / "bus.log", own), tmp_path / "out.log")
    assert compared(live, made) > 80
    slots = {stamp for can_id, stamp in made if can_id == ADHESION_A1}
    sent = {f.stamp_us for f in live.link.sent if f.can_id == ADHESION_A1}
    assert slots == {s for s in sent if s <= max(slots)}  # and nothing else was made
    assert live.sim.core.counts.time_steps == 0


def test_long_silence_is_filled_only_if_the_log_shows_that_time_passed(config: Config, tmp_path: Path) -> None:
    live = Live(config)
    live.run(1.5)
    live.run(65.0, there=False)
    live.run(1.5)
    made = replayed(live.logged(tmp_path / "bus.log", own=True), tmp_path / "out.log")
    assert compared(live, made) > 40
    made = replayed(live.logged(tmp_path / "sensors.log", own=False), tmp_path / "out2.log")
    assert len([1 for can_id, _ in made if can_id == ADHESION_A1]) < 200


@pytest.mark.parametrize("seconds", [3.0, 100.0, -3.0])
def test_log_with_a_time_step_replays_to_what_was_sent(config: Config, tmp_path: Path, seconds: float) -> None:
    live = Live(config)
    live.run(2.0)
    live.step(seconds)
    live.run(2.0)
    log = tmp_path / "bus.log"
    log.write_text("".join(format_line(f, "vcan0") + "\n" for f in live.lines))
    assert live.sim.core.counts.time_steps == 1
    newest = live.lines[-1].stamp_us
    made = replayed(log, tmp_path / "out.log")
    # after the step: what was sent before a step back has the same stamps
    sent = [f for f in live.link.sent if f.can_id in ESTIMATES][-12 * 40 :]
    before = [f for f in sent if f.stamp_us <= newest]
    assert [made.get((f.can_id, f.stamp_us)) for f in before] == [f.data for f in before]


@pytest.mark.parametrize(("seconds", "held"), [(0.5, 100), (3.0, 600), (3.0, 60), (5.0, 0)])
def test_stalled_loop_is_no_time_step(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seconds: float, held: int
) -> None:
    """The kernel's buffer has held all frames of that time, the first of them, or none."""
    monkeypatch.setattr(recorder, "EXIT_S", 60.0)
    live = Live(config, tmp_path / "dumps")
    live.run(2.0)
    live.stall(seconds, held)
    live.run(2.0)
    assert live.sim.core.counts.time_steps == 0
    made = replayed(live.logged(tmp_path / "bus.log", own=False), tmp_path / "out.log")
    assert compared(live, made) > 80
    assert live.recorder is not None
    live.recorder.ask()
    live.recorder.close(live.now())
    (dump,) = (tmp_path / "dumps").glob("*.log")
    assert compared(live, replayed(dump, tmp_path / "dump-out.log")) > 80


def test_clock_step_during_a_stall_is_a_time_step(config: Config) -> None:
    live = Live(config)
    live.run(2.0)
    live.step(10.0)
    live.stall(2.0, held=0)
    live.run(0.1)
    assert live.sim.core.counts.time_steps == 1


def test_default_clocks_show_no_time_step() -> None:
    """A loop on its default clocks sees no step in a second of doing nothing."""
    core = Core(load_config(None))
    daemon = Daemon(core, ScriptedLink())
    for _ in range(3):
        daemon.turn()
        time.sleep(0.4)
    daemon.turn()
    daemon.turn()
    assert core.counts.time_steps == 0
