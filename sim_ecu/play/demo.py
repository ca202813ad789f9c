"""`sim-ecu demo`: rig and daemon on one bus, the estimate against the truth as it goes; then picture and report of its
log."""

import contextlib
import math
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sim_ecu import resources
from sim_ecu.play.demo_screen import Screen
from sim_ecu.play.interface import open_bus
from sim_ecu.play.mapped import MappedTrain, Train
from sim_ecu.play.observer import BusObserver, ObservedTrace
from sim_ecu.play.pace import Pace, RealPace
from sim_ecu.play.play import PlayTally, RealTime
from sim_ecu.play.scenario import Scenario, load_scenario
from sim_ecu.play.train import PACKAGED, placed
from wrcd.bus import pythoncan
from wrcd.bus.opening import open_link
from wrcd.config.config import DEFAULT_AXLES, load_config, load_packaged
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.errors import Status
from wrcd.service.loop import Daemon

SHOW_EVERY_S = 0.5
WITHOUT_VCAN = " (python-can's virtual bus: this kernel has no vcan0)"


def run(interface: str, channel: str, scenario_name: str, folder: Path, config_file: Path | None = None) -> int:
    """Play a scenario in real time with the daemon beside it, both with one configuration. Returns 1 if no valid
    estimate was seen."""
    scenario = load_scenario(scenario_name)
    numbers = [a.number for a in scenario.axles]
    train: Train = PACKAGED
    if config_file is None:
        config = placed(load_packaged(max(DEFAULT_AXLES, *numbers)), scenario)
    else:
        config = load_config(config_file)
        train = MappedTrain(config, scenario.wheelset)
    folder.mkdir(parents=True, exist_ok=True)
    log, picture, report = (folder / f"{scenario.name}.{suffix}" for suffix in ("log", "png", "html"))
    note = WITHOUT_VCAN if (interface, channel) == ("virtual", "demo") else ""
    print(f"{scenario.name}: {scenario.title}\non {interface} {channel}{note}, {scenario.duration_s:g} s")
    traces, tally, came_to = _play(scenario, interface, channel, log, config, train)
    if tally.too_slow:
        print(f"\n{tally.too_slow[0].upper()}{tally.too_slow[1:]}. Try again when it is idle.")
    print(f"\n{came_to}")
    print(f"log      {_shown(log)}")
    _leave(log, picture, report, numbers, config_file)
    _print_why(log, traces, config, config_file)
    good = any(a["Validity"] == "Valid" for trace in traces.values() for _, a in trace.adhesion)
    if not good:
        print("sim-ecu: no valid estimate was seen", file=sys.stderr)
    return 0 if good else 1


def _play(
    scenario: Scenario, interface: str, channel: str, log: Path, config: Config, train: Train
) -> tuple[dict[int, ObservedTrace], PlayTally, str]:
    """Play in real time. Returns what was seen of each axle, and what playing came to, as figures and as text."""
    numbers = [a.number for a in scenario.axles]
    # without a kernel that stamps frames, time may wait for a busy computer
    pace = Pace() if interface == "virtual" else RealPace()
    with contextlib.ExitStack() as cleanup:
        core = Core(config)
        fd: dict[str, Any] = {"fd": True} if train.has_fd else {}
        observer_bus = cleanup.enter_context(pythoncan.open_bus(interface, channel, user_settings=True, **fd))
        observer = BusObserver(observer_bus, log, channel, config, numbers, pace)
        cleanup.callback(observer.close)
        link = open_link(interface, channel, core.mapped.keys, fd=core.mapped.fd, user_settings=True)
        cleanup.callback(link.close)
        own_stamps = {"preserve_timestamps": True} if interface == "virtual" else {}
        rig_bus = cleanup.enter_context(open_bus(interface, channel, train.has_fd, **own_stamps))
        screen, shown = Screen(numbers), 0

        daemon = Daemon(core, link, clock=pace.wall_us, steady=pace.steady_us, write=lambda _: None)
        screen.begin()
        rig = RealTime(scenario, rig_bus, None, ahead=True, train=train, clock=pace)
        shown_s = 0.0
        pace.begin()
        while rig.step():
            rig_s, tick_s = rig.wait_s(), daemon.wait_s()
            pace.sleep(min(rig_s, tick_s))
            pace.turn()
            if rig_s < tick_s:
                continue
            daemon.turn()
            observer.drain()
            if (new := core.events.since(shown)) and observer.first_s is not None:
                screen.changes(new, observer.first_s)
                shown += len(new)
            if rig.time_s - shown_s >= SHOW_EVERY_S:
                shown_s += SHOW_EVERY_S
                screen.moment(observer.traces)
        for frame in core.shutdown_frames(pace.wall_us()):
            link.send(frame)
        observer.drain()
    came_to = (
        f"rig      {rig.tally.text()}\ndaemon   {core.counts.accepted} frames accepted, {daemon.sent} sent, "
        f"{core.health.overruns} overruns"
    )
    return observer.traces, rig.tally, came_to


FALL_FRAMES = 5  # 0.1 s: so long an estimate takes to follow a rail


def default_bus() -> tuple[str, str]:
    """Return interface and channel where none are given: vcan0 where there is one, else python-can's virtual bus."""
    return ("socketcan", "vcan0") if Path("/sys/class/net/vcan0").exists() else ("virtual", "demo")


def _shown(path: Path) -> Path:
    """From the working folder on, where it lies below it."""
    with contextlib.suppress(ValueError):
        return path.resolve().relative_to(Path.cwd())
    return path


def _leave(log: Path, picture: Path, report: Path, numbers: Sequence[int], config_file: Path | None) -> None:
    """Make picture and report of the demo's own log, with the truth in it. Where the extra is missing, it says so, and
    the demo has been shown all the same."""
    from wrcd.cli.main import main

    given = ["--dbc", str(resources.TRUTH_DBC), *(["--config", str(config_file)] if config_file else [])]
    axles = [word for number in numbers for word in ("--axle", str(number))]
    main(["report", str(_shown(log)), "--plot", str(_shown(picture)), "--force", *axles, *given])
    print("\nWhat the report says of it:", flush=True)
    if main(["report", str(_shown(log)), "-o", str(_shown(report)), *given]) == Status.DONE:
        print("Open it in a browser: what happened, when, and why.")


def _print_why(log: Path, traces: Mapping[int, ObservedTrace], config: Config, config_file: Path | None) -> None:
    """Print the command that explains the largest fall of a Valid estimate within FALL_FRAMES, at the time of the frame
    at its end, rounded up to the millisecond. Where the frames carry no causes it estimates them."""
    falls = []
    for number, trace in traces.items():
        sent = [(t, a.get("MuAvailable") if a.get("Validity") == "Valid" else None) for t, a in trace.adhesion]
        falls += [
            (after - before, time_s, number)
            for (_, before), (time_s, after) in zip(sent, sent[FALL_FRAMES:], strict=False)
            if isinstance(before, float | int) and isinstance(after, float | int) and after < before
        ]
    if not falls:
        return
    _, time_s, number = min(falls)
    words = ["wrcd", "why", str(_shown(log)), f"{math.ceil(time_s * 1000 - 1e-3) / 1000:.3f}", "--axle", str(number)]
    if config_file is not None:
        words += ["--config", str(config_file)]
    if any(a.number == number and a.detail is None for a in config.axles):
        words.append("--replay")
    print(f"Why did it fall? {shlex.join(words)}")
