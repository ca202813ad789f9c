"""The paper's own form as a design that the daemon runs."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.design.brief import explain, load_source
from sim_ecu.design.cases import FloatArray, Plan
from sim_ecu.design.make import Brief, bank, in_papers_form, write
from sim_ecu.design.make import fitted as fitted_design
from sim_ecu.design.paper import BORDERS_PCT, PaperRules, fit_paper, output_of, output_sets
from sim_ecu.design.recordings import record
from sim_ecu.design.rules import PAPER_POLYNOMIAL
from sim_ecu.resources import PAPER_DESIGN
from tests.oracle.rules import Rules
from tests.support.c_parts import infer
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.stepped import SteppedEstimator, Tick
from wrcd.checksum import checksum
from wrcd.core.design import Design, load_design, parse_design
from wrcd.core.terms import COLUMNS, MODELS
from wrcd.errors import InputError
from wrcd.logs.rule_sentences import condition, sentence

SETS = (3, 3, 8, 1)


def silent(_what: str, _share: float) -> None:
    pass


def fitted(n: int = 4000, noise: float = 0.0) -> tuple[FloatArray, FloatArray, PaperRules]:
    """Adhesion follows the torque (third input) and the first residual; the last input says nothing."""
    rng = np.random.default_rng(4)
    x = rng.uniform(-1.0, 1.0, (n, 4))
    mu = np.clip(10.0 ** (1.0 + 0.4 * x[:, 2] + 0.2 * x[:, 0]) * np.exp(noise * rng.standard_normal(n)), 1.0, 42.0)
    return x, mu, fit_paper(x, mu, SETS, 100, np.ones(n), np.arange(n))


def test_a_rule_says_the_output_set_nearest_to_its_windows() -> None:
    x, mu, rules = fitted()
    _, middles = output_sets()
    assert set(rules.bases) <= set(middles)
    assert not rules.slopes.any()
    assert not rules.spread_slopes.any()
    share, _ = rules.shares(x)
    mean = share.T @ output_of(mu) / share.sum(axis=0)
    assert rules.bases == pytest.approx(middles[np.abs(mean[:, None] - middles).argmin(axis=1)])
    # the name says where it lies
    dry, slippery = (rules.says[r] for r in (int(mean.argmin()), int(mean.argmax())))
    assert dry < slippery
    assert np.abs(rules.mu_pct(x) - mu).mean() < 2.0


def test_the_output_sets_are_named_by_the_papers_adhesions() -> None:
    names, middles = output_sets()
    assert {"mu >= 40 %", "20 % >= mu >= 10 %"} <= set(names)  # the two that the paper prints
    assert np.all(np.diff(middles) > 0)
    mu = np.polyval(PAPER_POLYNOMIAL, middles)
    borders = [1e9, *BORDERS_PCT, 0.0]
    for level, above, below in zip(mu, borders, borders[1:], strict=False):
        assert below < level < above


def test_constant_spreads_cover_what_they_claim() -> None:
    x, mu, rules = fitted(noise=0.2)
    guess = rules.mu_pct(x)
    assert 0.82 <= (np.abs(guess - mu) <= rules.spread(x) * guess).mean() <= 0.97


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small design in the paper's form."""
    brief = in_papers_form(Brief())
    brief = replace(brief, grid=24, plan=replace(brief.plan, speeds=2, per_speed=16, seed=9))
    path = tmp_path_factory.mktemp("paper") / "paper.json"
    recordings = record(brief.wheelset, brief.plan, brief.tick_s, silent)
    write(fitted_design(brief, bank(brief), recordings, silent), path)
    return path


def test_the_design_file_is_what_the_paper_describes(file: Path) -> None:
    d = load_design(file)
    names, middles = output_sets()
    assert d.form == "paper"
    assert [len(s.names) for s in d.sets] == [3, 3, 3, 3, 8, 1]
    assert d.polynomial == pytest.approx(PAPER_POLYNOMIAL)
    assert len(d.consequents) == len(d.rules)
    assert all(base == middles[names.index(said)] for said, base in zip(d.consequents, d.bases, strict=True))
    assert not d.slopes.any()
    assert d.longest_s == d.window_s
    assert d.whiten == pytest.approx(np.broadcast_to(np.diag(1.0 / d.noise_rms), d.whiten.shape))
    assert load_source(file).windows > 0


def run(d: Design, seconds: float, speed: float = 20.0, step_at_s: float = 99.0) -> tuple[SteppedEstimator, FloatArray]:
    """White signals, torque doubled from a moment on; the estimator and its innovations (ticks, 4, 2, 2)."""
    rng = np.random.default_rng(2)
    estimator, present, e = SteppedEstimator(d, 2), np.ones((2, 2), dtype=bool), []
    for k in range(round(seconds / d.tick_s)):
        z = rng.standard_normal((2, 2)) * 5.0 * d.noise_rms[:, None]
        ratio = np.full(2, 0.05 if k * d.tick_s < step_at_s else 0.1)
        e.append(estimator.step(Tick(k, z, present, ratio, speed)).innovations)
    return estimator, np.array(e)


def test_the_daemon_sees_the_raw_residuals(file: Path) -> None:
    d = load_design(file)
    estimator, e = run(d, 2.5)
    found = estimator.estimate()
    assert np.isfinite(found.mu_available_pct).all()
    assert np.isfinite(found.half_width_pp).all()
    assert 10.0 ** found.inputs[:, :MODELS] == pytest.approx(found.residuals)
    # the RMS of both channels in units of the sensors' noise: no filter behind, no noise taken off
    scaled = e[-d.window_ticks :] / d.noise_rms[:, None]
    rms = np.sqrt(np.square(scaled - scaled.mean(axis=0)).mean(axis=(0, 2))).T
    assert found.residuals == pytest.approx(rms, rel=0.03)


def test_paper_window_neither_grows_nor_drops(file: Path) -> None:
    papers, ours = load_design(file), load_design(LONE_DESIGN)
    for step_at_s in (99.0, 2.9):
        estimator, _ = run(papers, 3.0, step_at_s=step_at_s)
        assert estimator.estimate().window_s == pytest.approx(papers.window_s)
    assert run(ours, 3.0)[0].estimate().window_s == pytest.approx(ours.window_s)
    assert run(ours, 3.0, step_at_s=2.9)[0].estimate().window_s[0] < 0.5


def inputs(d: Design, n: int) -> FloatArray:
    rng = np.random.default_rng(6)
    x = rng.uniform(-1.0, 1.0, (n, COLUMNS))
    for i, s in enumerate(d.sets[:-1]):
        x[:, i] = rng.uniform(s.centres[0] - 0.2, s.centres[-1] + 0.2, n)
    return x


def test_one_set_of_speeds_holds_at_all_of_them(file: Path) -> None:
    d = load_design(file)
    x = inputs(d, 60)
    found = np.array([a.output for a in infer(d, x)])
    assert np.isfinite(found).sum() > 20
    assert found == pytest.approx(Rules(d).infer(x).output, abs=1e-9, nan_ok=True)
    other = x.copy()
    other[:, MODELS + 1] = 0.5 - x[:, MODELS + 1]
    other[:, MODELS + 2 :] *= -1.0  # nor do correlations, lengths and noise count
    assert np.array_equal([a.output for a in infer(d, other)], found, equal_nan=True)


def test_paper_rules_read_as_printed(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    d = load_design(file)
    assert "Any" not in condition(d, 0)
    assert sentence(d, 0).startswith("If residual 1 ")
    assert f", then {d.consequents[0]} (output {d.bases[0]:.0f}, adhesion " in sentence(d, 0)
    assert explain(file) == 0
    out = capsys.readouterr().out
    assert "residual 1, in the sensors' noise: Low about" in out
    assert "speed, m/s" not in out
    assert "persistence" not in out


def changed(file: Path, path: str, value: Any) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(file.read_text())
    *way, last = path.split(".")
    node = document
    for key in way:
        node = node[key]
    node[last] = value
    return document | {"checksum": checksum(document)}


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("fuzzy.torque", {"names": ["Any"], "centres": [0.0]}, "2 or more centres"),
        ("fuzzy.speed", {"names": [], "centres": []}, "finite numbers"),
        ("fuzzy.consequents", ["mu >= 40 %"], "names"),
        ("fuzzy.consequents", "mu", "names"),
        ("form", "papers", "must be one of wrcd, paper"),
    ],
)
def test_paper_design_with_a_wrong_value_is_rejected(file: Path, key: str, value: Any, says: str) -> None:
    with pytest.raises(InputError, match=says) as e:
        parse_design(changed(file, key, value), "x.json")
    assert key in str(e.value)


def test_packaged_paper_design_is_for_the_default_wheelset() -> None:
    papers, ours = load_source(PAPER_DESIGN), load_source(LONE_DESIGN)
    assert papers.design.form == "paper"
    assert papers.wheelset == ours.wheelset
    assert papers.sensors == ours.sensors
    assert [(p.curve, p.creep_of_peak) for p in papers.points] == [(p.curve, p.creep_of_peak) for p in ours.points]
    assert (papers.design.tick_s, papers.design.window_s) == (ours.design.tick_s, ours.design.window_s)


def test_the_papers_form_needs_no_other_worlds() -> None:
    plan = in_papers_form(Brief(plan=Plan(seed=7))).plan
    assert (plan.worlds, plan.quiet_share, plan.noisy_share, plan.seed) == (False, 0.0, 0.0, 7)
