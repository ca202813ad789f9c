"""The engine on the train against filterpy and scikit-fuzzy, over real logs."""

import random
from pathlib import Path

import pytest

from sim_ecu.design.verify import MOST_FUZZY, MOST_INNOVATION, compare, run
from tests.conftest import LogOf
from tests.scenarios import CHANGING_SPEED, FOUR_AXLES, held
from wrcd.daemon.config import load_config

LOGS = {"held": held("C", 6.0), "changing speed": CHANGING_SPEED, "four axles": FOUR_AXLES}


def agree(log: Path) -> None:
    found = compare(log, load_config(None), fuzzy_every_s=2.0)
    assert found.ticks > 1000
    assert found.innovation <= MOST_INNOVATION * found.largest
    assert found.largest > 0
    assert len(found.fast) >= 3
    assert found.fuzzy <= MOST_FUZZY
    # what steady-state gains cost against live covariances is stated; without losses it is small
    assert found.live_square > 0


@pytest.mark.parametrize("name", LOGS)
def test_the_engines_agree(log_of: LogOf, name: str) -> None:
    agree(log_of(LOGS[name]))


def test_they_agree_where_frames_are_lost(log_of: LogOf, tmp_path: Path) -> None:
    rng = random.Random(5)
    lines = [x for x in log_of(CHANGING_SPEED).read_text().splitlines() if rng.random() > 0.05]
    lossy = tmp_path / "lossy.log"
    lossy.write_text("\n".join(lines) + "\n")
    agree(lossy)


def test_a_difference_is_found(
    log_of: LogOf, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from wrcd.estimator import bank

    monkeypatch.setattr(bank, "SPEED_STEP", 0.5)  # the fast engine schedules its gains on another speed
    assert run(log_of(CHANGING_SPEED), None, 1.0) == 1
    assert capsys.readouterr().out.endswith("DIFFER\n")
