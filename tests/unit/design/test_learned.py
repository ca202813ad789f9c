"""The baseline that learns from a design's recordings: what they are given, and that they come back from their file."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.design.cases import FloatArray, Plan
from sim_ecu.design.features import quietly, run
from sim_ecu.design.make import Brief, bank, fitted, write
from sim_ecu.design.recordings import Recording, record
from sim_ecu.score.baselines import GivenTicks, Regressor, learn, load
from wrcd.errors import InputError
from wrcd.estimator.design import COLUMNS, Design, load_design

PLAN = Plan(seed=12, speeds=2, per_speed=30, changed_share=0.3)


@dataclass(frozen=True)
class Made:
    """A small design, its recordings, and what was learnt from them."""

    design: Design
    recordings: list[Recording]
    file: Path
    network: Regressor


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    folder = tmp_path_factory.mktemp("learned")
    brief = Brief(plan=PLAN, grid=24, max_rules=8)
    recordings = record(brief.wheelset, PLAN, brief.tick_s, quietly)
    write(fitted(brief, bank(brief), recordings, quietly), folder / "design.json")
    d = load_design(folder / "design.json")
    write(learn(d, recordings, PLAN), folder / "baselines.json")
    network = load(folder / "baselines.json", d)
    assert network is not None
    return Made(d, recordings, folder / "baselines.json", network)


def ends(m: Made) -> Iterator[tuple[Recording, GivenTicks, FloatArray]]:
    """Every recording with the ticks that the train would see, and which conditions have been as they are for a second
    at its end."""
    for r in m.recordings:
        t, n = r.torque.shape
        ratio = np.abs(r.torque.astype(np.float64)) / (2 * m.design.normal_N * m.design.r_0)
        seen = np.full((t, n, COLUMNS), np.nan)
        for k, estimator in run(m.design, r.z, r, [t - 1]):
            seen[k] = estimator.estimate().inputs
        present = np.ones((t, 2, n), dtype=bool)
        z = r.z.astype(np.float64)
        ticks = GivenTicks(z, present, ratio, r.speed_m_s, m.design.tick_s, np.arange(t), seen)
        yield r, ticks, np.asarray(t - r.first >= m.design.window_ticks, dtype=np.float64)


def test_network_knows_more_than_the_torque(made: Made) -> None:
    errors: dict[str, list[FloatArray]] = {"torque": [], "network": []}
    for r, ticks, whole in ends(made):
        said = {
            "torque": 100.0 * ticks.torque_ratio[-200:].mean(axis=0),
            "network": made.network.mu_pct(ticks)[-1],
        }
        for name, mu in said.items():
            known = (whole > 0) & np.isfinite(mu)
            assert known.sum() > 0.7 * len(known)
            errors[name].append(np.abs(mu - r.mu_pct[-1])[known])
    mean = {name: float(np.concatenate(e).mean()) for name, e in errors.items()}
    assert mean["network"] < 0.75 * mean["torque"]


def test_inputs_unlike_any_are_held(made: Made) -> None:
    net = made.network
    far = np.vstack([net.mean + s * net.size for s in (4.0, 40.0, -4.0, -40.0)])
    said = net.answer(far)
    assert said[0] == pytest.approx(said[1])
    assert said[2] == pytest.approx(said[3])
    assert said[0] != pytest.approx(said[2])


def test_baselines_belong_to_one_design(made: Made, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not belong"):
        load(made.file, replace(made.design, checksum="0" * 64))
    document = json.loads(made.file.read_text())
    del document["regressor"]["mean"]
    damaged = tmp_path / "damaged.json"
    damaged.write_text(json.dumps(document))
    with pytest.raises(InputError, match="damaged"):
        load(damaged, made.design)
