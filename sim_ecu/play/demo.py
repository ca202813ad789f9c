"""`sim-ecu demo`: rig and daemon on one bus, the estimate against the truth as it goes; then a log and a picture."""

import contextlib
import math
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import can
from cantools.database.can import Message

from sim_ecu.play.adhesion import AdhesionReader, Said
from sim_ecu.play.encoder import databases, message_key
from sim_ecu.play.interface import open_bus
from sim_ecu.play.mapped import MappedTrain
from sim_ecu.play.play import RealTime
from sim_ecu.play.scenario import Scenario, load_scenario
from sim_ecu.play.train import PACKAGED, Train
from wrcd.bus import pythoncan
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.log import format_line
from wrcd.bus.opening import open_link
from wrcd.config import DEFAULT_AXLES, load_config, load_packaged
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.vocabulary import CONFIDENCES
from wrcd.service.loop import Daemon, wall_us

SHOW_EVERY_S = 0.5
WITHOUT_VCAN = " (python-can's virtual bus: this kernel has no vcan0)"
FULL_SCALE_PCT, WIDTH = 50.0, 50
WIDEST_PP = 20.0  # what is drawn of an interval without a bound
HALF_WIDTHS = {name: min(half_width, WIDEST_PP) for half_width, name in CONFIDENCES}


@dataclass(slots=True)
class Trace:
    """One axle as seen on the bus: rows of (time, what a frame says)."""

    truth: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    adhesion: list[tuple[float, Said]] = field(default_factory=list)


class Observer:
    """A third party on the bus: writes the log, and decodes what anyone could decode."""

    def __init__(self, bus: can.BusABC, log: Path, channel: str, config: Config, numbers: list[int]) -> None:
        _, rig = databases()
        self._bus, self._channel = bus, channel
        self._file = log.open("w", encoding="ascii")
        self.traces = {n: Trace() for n in numbers}
        outputs = {a.number: a.adhesion for a in config.axles}
        self._truth: dict[int, tuple[Message, Trace]] = {}
        self._adhesion: dict[int, tuple[AdhesionReader, Trace]] = {}
        for n, trace in self.traces.items():
            truth = rig.get_message_by_name(f"SimTruth_A{n}")
            self._truth[message_key(truth)] = truth, trace
            message = find_message(config.database, outputs[n].message)
            self._adhesion[message_key(message)] = AdhesionReader(message, outputs[n]), trace
        self._first: float | None = None

    def drain(self) -> None:
        """Take all that is on the bus."""
        while (m := self._bus.recv(0.0)) is not None:
            frame = Frame(
                round(m.timestamp * 1e6), m.arbitration_id, bytes(m.data), extended=m.is_extended_id,
                remote=m.is_remote_frame, error=m.is_error_frame, fd=m.is_fd,
            )  # fmt: skip
            self._file.write(format_line(frame, self._channel) + "\n")
            self._first = m.timestamp if self._first is None else self._first
            t = m.timestamp - self._first
            if (truth := self._truth.get(frame.key)) is not None:
                true: Any = truth[0].decode(frame.data)
                truth[1].truth.append((t, true))
            elif (adhesion := self._adhesion.get(frame.key)) is not None:
                adhesion[1].adhesion.append((t, adhesion[0].read(frame.data)))

    def close(self) -> None:
        """Finish the log."""
        self.drain()
        self._file.close()


def run(interface: str, channel: str, scenario_name: str, folder: Path, config_file: Path | None = None) -> int:
    """Play a scenario in real time with the daemon beside it, both with one configuration. Returns 1 if no valid
    estimate was seen."""
    scenario = load_scenario(scenario_name)
    numbers = [a.number for a in scenario.axles]
    train: Train = PACKAGED
    if config_file is None:
        config = load_packaged(max(DEFAULT_AXLES, *numbers))
    else:
        config = load_config(config_file)
        train = MappedTrain(config, scenario.wheelset.normal_N, scenario.wheelset.r_0)
    folder.mkdir(parents=True, exist_ok=True)
    log, picture = folder / f"{scenario.name}.log", folder / f"{scenario.name}.png"
    told = WITHOUT_VCAN if (interface, channel) == ("virtual", "demo") else ""
    print(f"{scenario.name}: {scenario.title}\non {interface} {channel}{told}, {scenario.duration_s:g} s")
    with contextlib.ExitStack() as cleanup:
        core = Core(config)
        fd: dict[str, Any] = {"fd": True} if train.has_fd else {}
        observer_bus = cleanup.enter_context(pythoncan.open_bus(interface, channel, user_settings=True, **fd))
        observer = Observer(observer_bus, log, channel, config, numbers)
        cleanup.callback(observer.close)
        link = open_link(interface, channel, core.receiver.keys, fd=core.receiver.fd, user_settings=True)
        cleanup.callback(link.close)
        rig_bus = cleanup.enter_context(open_bus(interface, channel, train.has_fd))
        daemon = Daemon(core, link)
        rig = RealTime(scenario, rig_bus, None, train=train)
        shown = time.monotonic()
        while rig.step():
            rig_s, tick_s = rig.wait_s(), daemon.wait_s()
            time.sleep(min(rig_s, tick_s))
            if rig_s < tick_s:
                continue
            daemon.turn()
            observer.drain()
            if time.monotonic() - shown >= SHOW_EVERY_S:
                shown += SHOW_EVERY_S
                _show(observer.traces)
        for frame in core.shutdown_frames(wall_us()):
            link.send(frame)
        observer.drain()
    print(
        f"rig: {rig.tally.text()}\ndaemon: {core.counts.accepted} frames accepted, "
        f"{daemon.sent} sent, {core.health.overruns} overruns"
    )
    _draw(scenario, observer.traces, picture)
    print(f"log      {log}\npicture  {picture}")
    good = _summary(observer.traces)
    if not good:
        print("sim-ecu: no valid estimate was seen", file=sys.stderr)
    return 0 if good else 1


def default_bus() -> tuple[str, str]:
    """Interface and channel where nothing says others: vcan0 where there is one, else python-can's virtual bus."""
    return ("socketcan", "vcan0") if Path("/sys/class/net/vcan0").exists() else ("virtual", "demo")


def _show(traces: dict[int, Trace]) -> None:
    """A line per axle: T is the truth, E the estimate, * both, = what is in use."""
    for number, trace in traces.items():
        if not trace.truth or not trace.adhesion:
            continue
        t, true = trace.truth[-1]
        a = trace.adhesion[-1][1]
        bar = ["·"] * (WIDTH + 1)
        for i in range(_place(float(true["MuUsed"])) + 1):
            bar[i] = "="
        bar[_place(float(true["MuAvailable"]))] = "T"
        shown = "   –  "
        if isinstance(mu := a["MuAvailable"], float):
            at = _place(mu)
            bar[at] = "*" if bar[at] == "T" else "E"
            shown = f"{mu:5.1f}%"
        classes = [str(a.get(name, "–")) for name in ("ContactState", "Surface", "Confidence")]
        print(
            f"{t:5.1f} s A{number} |{''.join(bar)}| truth {true['MuAvailable']:5.1f}%  estimate {shown}  "
            f"{a['Validity']!s:12} {classes[0]:9} {classes[1]:8} {classes[2]}",
            flush=True,
        )


def _place(pct: float) -> int:
    return min(max(round(pct / FULL_SCALE_PCT * WIDTH), 0), WIDTH)


def _pairs(trace: Trace) -> list[tuple[float, float, float]]:
    """(time, estimate, truth) of every Valid frame."""
    out, k = [], 0
    for t, a in trace.adhesion:
        while k + 1 < len(trace.truth) and trace.truth[k + 1][0] <= t:
            k += 1
        if a["Validity"] == "Valid" and isinstance(mu := a["MuAvailable"], float) and trace.truth:
            out.append((t, mu, float(trace.truth[k][1]["MuAvailable"])))
    return out


def _summary(traces: dict[int, Trace]) -> bool:
    seen = False
    for number, trace in traces.items():
        pairs = _pairs(trace)
        seen |= bool(pairs)
        if pairs:
            errors = sorted(abs(e - true) for _, e, true in pairs)
            print(
                f"axle {number}: {len(pairs)} valid frames of {len(trace.adhesion)}, error of the estimate: median "
                f"{errors[len(errors) // 2]:.1f}, mean {sum(errors) / len(errors):.1f} percentage points "
                "(changes of rail included)"
            )
    return seen


def _draw(scenario: Scenario, traces: dict[int, Trace], picture: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(traces), 1, figsize=(9, 1.2 + 3.2 * len(traces)), squeeze=False, sharex=True)
    for (number, trace), ax in zip(traces.items(), axes[:, 0], strict=True):
        t = [row[0] for row in trace.truth]
        ax.plot(t, [row[1]["MuAvailable"] for row in trace.truth], color="black", lw=1.5, label="available, truth")
        ax.fill_between(t, [row[1]["MuUsed"] for row in trace.truth], color="0.85", lw=0, label="in use, truth")
        # where there is no estimate the line has a gap
        x = [s for s, _ in trace.adhesion]
        mu = [m if isinstance(m := a["MuAvailable"], float) else math.nan for _, a in trace.adhesion]
        half = [HALF_WIDTHS.get(str(a.get("Confidence")), 0.0) for _, a in trace.adhesion]
        ax.fill_between(
            x, [max(m - h, 0) for m, h in zip(mu, half, strict=True)], [m + h for m, h in zip(mu, half, strict=True)],
            color="tab:blue", alpha=0.2, lw=0, label="interval that Confidence claims",
        )  # fmt: skip
        ax.plot(x, mu, color="tab:blue", lw=1.2, label="available, wrcd")
        ax.set_ylabel(f"axle {number}: adhesion, %")
        ax.set_ylim(0, 55)
        ax.grid(alpha=0.3)
        ax.legend(loc="upper right", fontsize=8, ncols=2)
    axes[-1, 0].set_xlabel("time, s")
    figure.suptitle(f"{scenario.name}: {scenario.title}", fontsize=11)
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    plt.close(figure)
