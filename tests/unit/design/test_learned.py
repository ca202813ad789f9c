"""Baselines that learn from a design's recordings: what they are given, and that they come back from their file."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.design.cases import FloatArray, Plan
from sim_ecu.design.features import run
from sim_ecu.design.make import Brief, design, write
from sim_ecu.design.recordings import Recording
from sim_ecu.score.learned import Learned, learn, load
from sim_ecu.score.ticks import Ticks
from wrcd.errors import InputError
from wrcd.estimator.design import COLUMNS, Design, load_design

PLAN = Plan(seed=12, speeds=3, per_speed=40, changed_share=0.3)


@dataclass(frozen=True)
class Made:
    """A small design, its recordings, and what was learnt from them."""

    design: Design
    recordings: list[Recording]
    file: Path
    learned: Learned


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    folder = tmp_path_factory.mktemp("learned")
    document, recordings = design(Brief(plan=PLAN, grid=24, max_rules=8), lambda *_: None)
    write(document, folder / "design.json")
    d = load_design(folder / "design.json")
    write(learn(d, recordings, PLAN), folder / "baselines.json")
    return Made(d, recordings, folder / "baselines.json", load(folder / "baselines.json", d))


def ends(m: Made) -> Iterator[tuple[Recording, Ticks, FloatArray]]:
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
        ticks = Ticks(z, present, ratio, r.speed_m_s, m.design.tick_s, np.arange(t), seen)
        yield r, ticks, np.asarray(t - r.first >= m.design.window_ticks, dtype=np.float64)


def test_baselines_know_more_than_the_torque(made: Made) -> None:
    errors: dict[str, list[FloatArray]] = {"torque": [], "filterless": [], "network": []}
    assert made.learned.regressor is not None
    for r, ticks, whole in ends(made):
        said = {
            "torque": 100.0 * ticks.torque_ratio[-200:].mean(axis=0),
            "filterless": made.learned.filterless.mu_pct(ticks)[-1],
            "network": made.learned.regressor.mu_pct(ticks)[-1],
        }
        for name, mu in said.items():
            known = (whole > 0) & np.isfinite(mu)
            assert known.sum() > 0.7 * len(known)
            errors[name].append(np.abs(mu - r.mu_pct[-1])[known])
    mean = {name: float(np.concatenate(e).mean()) for name, e in errors.items()}
    assert mean["filterless"] < 0.75 * mean["torque"]
    assert mean["network"] < 0.75 * mean["torque"]


def test_a_condition_from_another_rail_teaches_nothing_before_its_window_is_whole(made: Made) -> None:
    """Else the filterless one would learn one rail's signal with another's adhesion."""
    mixed = []
    for r in made.recordings:
        late = r.first > 100
        truth = r.mu_pct.copy()
        truth[:, late] = np.nan  # a fit that took any of them in would not be finite
        mixed.append(replace(r, mu_pct=truth, first=np.where(late, len(r.z), r.first)))
    document = learn_filterless(made, mixed)
    assert np.isfinite(np.array(document["bases"], dtype=np.float64)).all()
    assert document["bases"] != learn_filterless(made, made.recordings)["bases"]


def learn_filterless(made: Made, recordings: list[Recording]) -> dict[str, list[float]]:
    from sim_ecu.score import learned

    with pytest.MonkeyPatch.context() as m:
        m.setattr(learned, "_network", lambda _: None)  # the rules' windows are another matter
        m.setattr(learned, "features", lambda *_: (None, None))
        found: dict[str, list[float]] = learned.learn(made.design, recordings, PLAN)["filterless"]
    return found


def test_inputs_unlike_any_are_held(made: Made) -> None:
    net = made.learned.regressor
    assert net is not None
    far = np.vstack([net.mean + s * net.size for s in (4.0, 40.0, -4.0, -40.0)])
    said = net.answer(far)
    assert said[0] == pytest.approx(said[1])
    assert said[2] == pytest.approx(said[3])
    assert said[0] != pytest.approx(said[2])


def test_baseline_without_a_rule_answers_with_the_adhesion_in_use(made: Made) -> None:
    r, ticks, _ = next(ends(made))
    f = made.learned.filterless
    mute = replace(f, rules=replace(f.rules, rules=f.rules.rules[:1], bases=f.rules.bases[:1],
                                    slopes=f.rules.slopes[:1]))  # fmt: skip
    used = 100.0 * ticks.torque_ratio[-200:].mean(axis=0)
    assert np.isclose(mute.mu_pct(ticks)[-1], used).sum() > 0.5 * r.z.shape[2]
    assert np.isclose(f.mu_pct(ticks)[-1], used).sum() < 0.5 * r.z.shape[2]


def test_baselines_belong_to_one_design(made: Made, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not belong"):
        load(made.file, replace(made.design, checksum="0" * 64))
    document = json.loads(made.file.read_text())
    del document["filterless"]["low"]
    damaged = tmp_path / "damaged.json"
    damaged.write_text(json.dumps(document))
    with pytest.raises(InputError, match="damaged"):
        load(damaged, made.design)
