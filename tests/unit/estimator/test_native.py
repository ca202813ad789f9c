"""The compiled estimator does as the reference in numpy: the same masks every tick, the same figures to 1e-9."""

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import fields
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.support.fuzzed_ticks import MAX_AXLES, Step, Train, designs
from tests.support.processes import ROOT
from wrcd.estimator.design import Design, FloatArray
from wrcd.estimator.engine import Engine
from wrcd.estimator.estimator import Estimator
from wrcd.estimator.native_estimator import CompiledEstimator
from wrcd.estimator.records import Estimate, StepResult

# Of the largest innovation of an axle since its reset, and of 1. What differs is the order of sums and the fused
# multiply-add of numpy's matrix product; a filter's closed loop makes a rounding of its state up to 140 times as large
# before it fades, and H turns a radian of it into up to 3200 m/s2.
CLOSE = 1e-9
# A window's figures come from running sums of squares: the largest of the last KEPT spans of TICKS takes the digits of
# the small ones. Above LARGE standard deviations, or so many times the least residual, the figures are ROUGH.
LARGE, LARGE_TO_RESIDUAL, TICKS, KEPT, ROUGH = 1000.0, 2e4, 100, 15, 1e-5
# The rules' inputs: correlations of a window whose power is nearly all mean and slope are what is left of those sums
# after both are taken off; of one in which nothing is live, and of which there is no estimate, even less is.
CLOSE_INPUTS, CLOSE_WITHOUT_DATA = 1e-7, 1e-6
MASKS = ("accepted", "outliers", "near_pulse", "live", "calm", "needs_reset")
WHOLE = ("rule", "winner", "saturated", "contradicted", "doubt", "regime")
designs_once = cache(designs)


class Pair:
    """Both engines over the same ticks; raises AssertionError where they differ."""

    def __init__(self, reference: Engine, other: Engine) -> None:
        self.reference, self.other = reference, other
        self._largest = np.ones(reference.axles)
        self._recent, self._ticks = np.zeros((KEPT, reference.axles)), 0
        self.worst = 0.0  # difference of figures that are to be close
        self.estimates = self.large = 0  # of axles; of which some value was large

    def run(self, steps: Iterable[Step], every: int) -> None:
        """every: ticks between two estimates."""
        for k, step in enumerate(steps):
            with np.errstate(all="ignore"):  # absurd values overflow in both
                ours, theirs = self.reference.step(step.tick), self.other.step(step.tick)
            self._compare_step(ours, theirs)
            resets = {*step.resets, *np.flatnonzero(ours.needs_reset).tolist()}
            if k % every == 0:
                with np.errstate(all="ignore"):
                    self._compare_answers()
            for axle in resets:
                self.reference.reset(axle)
                self.other.reset(axle)
                self._largest[axle] = 1.0

    def _compare_step(self, ours: StepResult, theirs: StepResult) -> None:
        for name in MASKS:
            assert getattr(ours, name).tolist() == getattr(theirs, name).tolist(), name
        assert ours.notable == theirs.notable
        self._largest = np.fmax(self._largest, np.abs(ours.whitened).max(axis=(0, 1)))
        self._largest = np.fmax(self._largest, np.abs(ours.innovations).max(axis=(0, 1)))
        span = self._ticks // TICKS % KEPT
        if self._ticks % TICKS == 0:
            self._recent[span] = 0.0
        self._recent[span] = np.fmax(self._recent[span], np.abs(ours.whitened).max(axis=(0, 1)))
        self._ticks += 1
        for name in ("innovations", "whitened"):
            self._close(name, getattr(ours, name) / self._largest, getattr(theirs, name) / self._largest, CLOSE)

    def _compare_answers(self) -> None:
        ours, theirs = self.reference.estimate(), self.other.estimate()
        recent = self._recent.max(axis=0)
        large = (recent > LARGE) | (recent > LARGE_TO_RESIDUAL * ours.residuals.min(axis=1))
        close = np.where(large, ROUGH, CLOSE)
        self.estimates += len(recent)
        self.large += int(large.sum())
        for field in fields(Estimate):
            x, y = getattr(ours, field.name), getattr(theirs, field.name)
            if field.name in WHOLE:
                assert x.tolist() == y.tolist(), field.name
            elif field.name == "inputs":
                silent = np.isnan(ours.residuals).any(axis=1)
                limit = np.where(silent, CLOSE_WITHOUT_DATA, CLOSE_INPUTS)
                self._close(field.name, x, y, np.maximum(limit, close))
            else:
                self._close(field.name, x, y, close)
        self._close("torque_now", self.reference.torque_now(), self.other.torque_now(), CLOSE)
        self._close("log_odds", self.reference.health.log_odds, self.other.health.log_odds, float(close.max()))
        assert self.reference.health.state.tolist() == self.other.health.state.tolist()
        assert self.reference.outliers == self.other.outliers
        assert self.reference.started.tolist() == self.other.started.tolist()

    def _close(self, name: str, x: FloatArray, y: FloatArray, close: float | FloatArray) -> None:
        """close: one difference for all, or one of each axle, the first axis."""
        assert x.shape == y.shape, name
        both = np.isfinite(x)
        assert np.array_equal(np.where(both, 0.0, x), np.where(np.isfinite(y), 0.0, y), equal_nan=True), name
        with np.errstate(invalid="ignore"):
            differ = np.where(both, np.abs(x - y), 0.0) / np.where(both, np.maximum(np.abs(x), 1.0), 1.0)
        limit = np.broadcast_to(
            np.asarray(close).reshape((-1,) + (1,) * (x.ndim - 1) if np.ndim(close) else ()), x.shape
        )
        assert (differ <= limit).all(), (name, float((differ / limit).max()))
        self.worst = max(self.worst, float(differ[limit == CLOSE].max(initial=0.0)))


@pytest.mark.parametrize(
    ("name", "axles"),
    [
        ("multiple-unit", 1), ("multiple-unit", 4), ("multiple-unit", 7), ("lone-wheelset", 2), ("lone-wheelset", 8),
        ("paper", 1), ("paper", 5), ("bare", 3),
    ],
)  # fmt: skip
def test_engines_agree_on_fuzzed_ticks(library: ctypes.CDLL, name: str, axles: int) -> None:
    pair = Pair(Estimator(designs_once()[name], axles), CompiledEstimator(library, designs_once()[name], axles))
    pair.run(Train(axles, 30 + axles).steps(1500), 17)
    assert pair.reference.outliers > 0
    assert name == "paper" or pair.large < 0.7 * pair.estimates


@pytest.mark.night
@pytest.mark.parametrize("axles", range(1, MAX_AXLES + 1))
@pytest.mark.parametrize("name", designs_once())
def test_engines_agree_on_a_million_fuzzed_ticks(library: ctypes.CDLL, name: str, axles: int) -> None:
    """A million in all of these."""
    pair = Pair(Estimator(designs_once()[name], axles), CompiledEstimator(library, designs_once()[name], axles))
    pair.run(Train(axles, 100 + axles).steps(31_250), 97)


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package, for a library of other sources."""
    folder = tmp_path_factory.mktemp("package")
    shutil.copytree(ROOT / "wrcd", folder / "wrcd", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def told(package: Path, **environment: str) -> str:
    code = "from wrcd import native; print(native.engine()); print(native.slow())"
    env = {k: v for k, v in os.environ.items() if k != "WRCD_ENGINE"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=package, env={**env, "PYTHONPATH": str(package), **environment},
        capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    return done.stdout


@pytest.mark.usefixtures("library")
def test_library_of_other_sources_is_not_used(package: Path) -> None:
    assert told(package).startswith("C11, compiled by ")
    source = package / "wrcd/estimator/c/rules.c"
    before = source.read_text()
    source.write_text(before.replace("MIN_FIRING = 0.05", "MIN_FIRING = 0.06"))
    os.utime(source, (0, 0))  # older than the library: that says nothing
    assert "reference (numpy)" in told(package)
    assert "is of other sources" in told(package)
    source.write_text(before)
    assert told(package).startswith("C11, compiled by ")


def test_reference_runs_where_it_is_asked_for_or_nothing_was_built(package: Path) -> None:
    asked = told(package, WRCD_ENGINE="reference").splitlines()
    assert asked == [
        "reference (numpy)",
        "no compiled estimator (WRCD_ENGINE asks for the reference): the reference in numpy runs, many times slower",
    ]
    for built in (package / "wrcd").glob("_native*.so"):
        built.write_bytes(b"")
        assert "cannot be used" in told(package)
        built.unlink()
    assert "(none was built)" in told(package)


def test_design_beyond_the_librarys_limits_is_the_references(library: ctypes.CDLL) -> None:
    design: Design = designs_once()["lone-wheelset"]
    with pytest.raises(ValueError, match="limits"):
        CompiledEstimator(library, design, MAX_AXLES + 1)
