"""The bank between the design's speeds."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.resources import PAPER_DESIGN
from wrcd.checksum import checksum
from wrcd.errors import InputError
from wrcd.estimator.bank import Bank
from wrcd.estimator.design import MODELS, STATES, load_design, parse_design
from wrcd.resources import DESIGN


@pytest.mark.parametrize("file", [DESIGN, PAPER_DESIGN], ids=["wrcd", "paper"])
def test_every_filter_forgets_at_every_speed(file: Path) -> None:
    design = load_design(file)
    bank, none = Bank(design, STATES), np.zeros((2, STATES))
    here = np.ones((2, STATES), dtype=bool)
    for speed in np.arange(design.speeds_m_s[0], design.speeds_m_s[-1], 0.37):
        bank.x = np.broadcast_to(np.eye(STATES), (MODELS, STATES, STATES)).copy()  # one state each
        bank.step(none, here, float(speed))
        decay = np.abs(np.linalg.eigvals(bank.x)).max(axis=1)
        assert (decay < 1.0).all(), (speed, decay)


def test_bank_between_grid_speeds_does_not_drift_in_a_minute() -> None:
    """It was not at two fifths of all speeds: the residual of model 4 grew fivefold in a minute."""
    design = load_design(DESIGN)
    bank, rng = Bank(design, 8), np.random.default_rng(1)
    here = np.ones((2, 8), dtype=bool)
    power = []
    for _ in range(round(60.0 / design.tick_s)):
        z = rng.standard_normal((2, 8)) * design.noise_rms[:, None]
        power.append(np.square(bank.step(z, here, 28.9)[1]).mean(axis=(1, 2)))
    early, late = (np.mean(part, axis=0) for part in (power[1000:4000], power[-3000:]))
    assert late == pytest.approx(early, rel=0.1)


def test_unstable_kalman_filter_is_rejected() -> None:
    document: dict[str, Any] = json.loads(DESIGN.read_text())
    K = np.array(document["bank"]["K"])
    K[7, 3] *= -1.0
    document["bank"]["K"] = K.tolist()
    document["checksum"] = checksum(document)
    with pytest.raises(InputError, match=r"bank\.K: makes a filter that is not stable"):
        parse_design(document, "x.json")
