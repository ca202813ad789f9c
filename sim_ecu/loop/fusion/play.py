"""One run, with a daemon's core that fuses and one that does not on the very same frames."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.make import make_controller
from sim_ecu.loop.fusion.patches import PLACES_M, Drive
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.play.encoder import SAMPLE_US, databases
from sim_ecu.play.play import LOG_START_US
from sim_ecu.score.heard import Heard
from wrcd.bus.frame import Frame
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
AXLES = range(1, len(PLACES_M) + 1)
SAMPLE_S = SAMPLE_US * 1e-6
LOW = ("Low", "VeryLow")
TRULY_LOW_PCT = 8.0


@dataclass(frozen=True, slots=True)
class Seen:
    """What was told to one axle: arrays by frame (n,). mu_pct and distance_m are NaN where not told."""

    time_s: FloatArray
    warns: BoolArray
    confirmed: BoolArray
    mu_pct: FloatArray
    distance_m: FloatArray


@dataclass(frozen=True, slots=True)
class Played:
    """A run as it came out.

    way_m (steps,), mu_pct (steps, axles): after each step of 5 ms, how far the train has come and the adhesion that
    each axle finds there. false_lows: Valid frames that call a rail low that is not. same: whether the adhesion frames
    with fusion are those without, byte for byte; true where none were made without.
    """

    drive: Drive
    seen: tuple[Seen, ...]
    way_m: FloatArray
    mu_pct: FloatArray
    false_lows: int
    same: bool


class _Ear:
    """Hears a core's frames: of adhesion every byte, of what lies ahead what a consumer hears."""

    def __init__(self, config: Config) -> None:
        production, _ = databases()
        self.core = Core(config)
        self.said = {a: Heard(production.get_message_by_name(f"Adhesion_A{a}")) for a in AXLES}
        self.ahead = {a: Heard(production.get_message_by_name(f"AdhesionAhead_A{a}")) for a in AXLES}
        self._by_id = {h.message.frame_id: h for h in (*self.said.values(), *self.ahead.values())}

    def feed(self, stamp_us: int, can_id: int, data: bytes) -> None:
        """A frame for wrcd."""
        for out in self.core.feed(Frame(LOG_START_US + stamp_us, can_id, data)):
            found = self._by_id.get(out.frame.can_id)
            if found is not None:
                found.stamps_us.append(out.frame.stamp_us - LOG_START_US)
                found.data.append(out.frame.data)


def play(drive: Drive, fusing: Config, plain: Config | None) -> Played:
    """Drive a run and gather what a core said whose configuration has fusion, and one without where there is such."""
    scenario = drive.scenario
    fused, alone = _Ear(fusing), None if plain is None else _Ear(plain)
    ears = [ear for ear in (fused, alone) if ear is not None]

    def frame(stamp_us: int, can_id: int, data: bytes) -> None:
        for ear in ears:
            ear.feed(stamp_us, can_id, data)

    controller = make_controller(drive.law, Facts.of(scenario), None)
    run = Lockstep(scenario, controller, None, frame, sensors=True)
    steps: list[tuple[float, FloatArray]] = []
    while not run.over:
        step = run.step()
        steps.append((step.distance_m, step.mu_available))
    mu_pct = 100.0 * np.array([mu for _, mu in steps])
    return Played(
        drive=drive,
        seen=tuple(_seen(fused.ahead[a]) for a in AXLES),
        way_m=np.array([d for d, _ in steps]),
        mu_pct=mu_pct,
        false_lows=_false_lows(fused, mu_pct),
        same=alone is None or all(fused.said[a].data == alone.said[a].data for a in AXLES),
    )


def _seen(heard: Heard) -> Seen:
    evidence = heard.words("Evidence")
    return Seen(
        time_s=np.array(heard.stamps_us) * 1e-6,
        warns=evidence != "None",
        confirmed=evidence == "Confirmed",
        mu_pct=heard.numbers("MuAhead"),
        distance_m=heard.numbers("Distance"),
    )


def _false_lows(ear: _Ear, mu_pct: FloatArray) -> int:
    """Valid frames that call a rail low that is not."""
    count = 0
    for k, said in enumerate(ear.said.values()):
        at = np.minimum((np.array(said.stamps_us) * 1e-6 / SAMPLE_S).round().astype(np.int64), len(mu_pct)) - 1
        low = (said.words("Validity") == Validity.VALID) & np.isin(said.words("Surface"), LOW)
        count += int(np.sum(low & (mu_pct[at, k] >= TRULY_LOW_PCT)))
    return count
