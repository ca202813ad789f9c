"""Conditions that are played side by side: what comes out is what an oracle of all axles says."""

from dataclasses import fields, replace

import numpy as np
import pytest

from sim_ecu.design.pairs import TRUSTING
from sim_ecu.design.side_by_side import SideBySide
from tests.oracle.estimator import Oracle
from tests.support.stepped import tick_of
from wrcd.core.design import load_design
from wrcd.core.estimator import step_through
from wrcd.core.records import Ticks
from wrcd.core.terms import MAX_AXLES, MODELS, SPAN_TICKS, PairState
from wrcd.resources import DESIGN

AXLES, TICKS = 11, 6 * SPAN_TICKS


def test_trains_side_by_side_say_what_an_oracle_of_all_axles_says() -> None:
    design, rng = replace(load_design(DESIGN), health=TRUSTING), np.random.default_rng(1)
    z = rng.standard_normal((TICKS, 2, AXLES)) * (5.0 * design.noise_rms[:, None])
    present = np.ones(z.shape, dtype=bool)
    present[:, :, 9] = False  # a partner that is not there
    present[SPAN_TICKS : 2 * SPAN_TICKS, :, 3] = False
    ticks = Ticks(7, z, present, rng.uniform(0.02, 0.05, (TICKS, AXLES)), [20.0] * TICKS)
    trains, one, done = SideBySide(design, AXLES), Oracle(design, AXLES), 0
    stops = range(SPAN_TICKS - 8, TICKS - 1, SPAN_TICKS)  # the ticks begin at 7: at a look's own
    for stop in step_through(trains, ticks, stops, resets=True):
        for k in range(done, stop + 1):
            for axle in np.flatnonzero(one.step(tick_of(ticks, k)).needs_reset).tolist():
                one.reset(axle)
        done = stop + 1
        assert trains.features() == pytest.approx(one.features(), rel=1e-7, abs=1e-7)
        found, expected = trains.estimate(), one.estimate()
        for f in fields(found):
            assert getattr(found, f.name) == pytest.approx(getattr(expected, f.name), rel=1e-7, abs=1e-7, nan_ok=True)
        few = trains.estimate(1).mu_available_pct
        assert np.array_equal(few, found.mu_available_pct[:MAX_AXLES], equal_nan=True)
    blocks, now = np.arange(20, 20 + AXLES), trains.torque_now()
    assert now == pytest.approx(one.torque_now(), nan_ok=True)
    assert trains.inputs_of(blocks, now) == pytest.approx(one.inputs_of(blocks, now), abs=1e-7, nan_ok=True)
    assert trains.steps().shape == (AXLES, MODELS)
    assert trains.steps() == pytest.approx(one.steps(), abs=1e-7, nan_ok=True)
    assert (one.health.state == PairState.SOUND).all()  # so a partner counts wherever it has data
