"""A bus or a file that is not there yet is looked for again, less often each time."""

from pathlib import Path

import pytest

from wrcd.config.config import DEFAULT, load_config_to_run
from wrcd.errors import BusError, InputError, NotThere
from wrcd.service.waiting import FIRST_PAUSE_S, LAST_PAUSE_S, Waiting


class Patient:
    """Waits on a clock of its own, and attempts that fail until a moment."""

    def __init__(self, seconds: float, there_at_s: float = 1e9, error: InputError | None = None) -> None:
        self.now_s = 100.0
        self.pauses: list[float] = []
        self._there_at_s = 100.0 + there_at_s
        self._error = error or BusError("can9 cannot be opened")
        self._waiting = Waiting(seconds, lambda: self.now_s, self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.pauses.append(seconds)
        self.now_s += seconds

    def attempt(self) -> str:
        if self.now_s < self._there_at_s:
            raise self._error
        return "there"

    def until(self) -> str:
        return self._waiting.until(self.attempt)


def test_pauses_double_up_to_half_a_second(capsys: pytest.CaptureFixture[str]) -> None:
    patient = Patient(20.0, there_at_s=7.0)
    assert patient.until() == "there"
    assert patient.pauses[:6] == pytest.approx([0.02, 0.04, 0.08, 0.16, 0.32, 0.5])
    assert max(patient.pauses) == LAST_PAUSE_S
    assert patient.now_s - 107.0 < LAST_PAUSE_S
    assert capsys.readouterr().err == "wrcd: can9 cannot be opened; waiting for it, 20 s at most\n"


def test_time_is_shared_by_all_attempts() -> None:
    """The unit's TimeoutStartSec= counts all of it."""
    waiting_s = 4.0
    patient = Patient(waiting_s, there_at_s=3.0)
    patient.until()
    patient._there_at_s = 1e9
    with pytest.raises(BusError):
        patient.until()
    assert patient.now_s == pytest.approx(100.0 + waiting_s)
    assert len(patient.pauses) < 18


@pytest.mark.parametrize(
    ("seconds", "there_at_s", "error", "says"),
    [
        (20.0, 0.0, None, ""),  # it is there
        (0.0, 1e9, None, "can9"),
        (20.0, 1e9, InputError("is not TOML"), "is not TOML"),  # bad input is not waited for
    ],
)
def test_nothing_to_wait_for_makes_no_pause(
    seconds: float, there_at_s: float, error: InputError | None, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    patient = Patient(seconds, there_at_s, error)
    if says:
        with pytest.raises(InputError, match=says):
            patient.until()
    else:
        assert patient.until() == "there"
    assert (patient.pauses, capsys.readouterr().err) == ([], "")


@pytest.mark.parametrize(
    "named",
    ["", "[dbc]\nfile = 'train.dbc'\n[wheelset]\nname = 'multiple-unit'\n", "[estimator]\ndesign = 'train.json'\n"],
)
def test_file_on_a_mount_that_comes_later_is_waited_for(tmp_path: Path, named: str) -> None:
    """The configuration, or a file that it names."""
    file = tmp_path / "train.toml"
    if named:
        file.write_text(named + DEFAULT)
    patient = Patient(0.1)
    with pytest.raises(InputError, match=r"no such (DBC |design )?file") as caught:
        patient._waiting.until(lambda: load_config_to_run(file))
    assert caught.value.status == NotThere.status == 3
    assert patient.pauses[0] == FIRST_PAUSE_S
