"""Keys of an earlier version: a warning names each with what to use instead, and nothing else comes of them."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.pages import ROOT
from tests.support.processes import wait_for
from wrcd.cli.main import main
from wrcd.config.config import DEFAULT, load_config
from wrcd.config.ended_keys import ENDED
from wrcd.core.configuration import Config
from wrcd.errors import InputError, InputErrors

ADVICE = "[advice]\nlow_from_m_s2 = 0.5\n"
FUSION = "[fusion]\npositions_m = [0.0, -2.5, -19, -21.5]\none_way = true\n"


def load(folder: Path, text: str, like: Config) -> Config:
    """What it gives, with another's DBC and design: they compare by identity, and no ended key speaks of them."""
    file = folder / "train.toml"
    file.write_text(text, encoding="utf-8")
    return replace(load_config(file), database=like.database, design=like.design)


LINES = DEFAULT.count("\n")


@pytest.mark.parametrize(
    ("text", "path", "key", "line"),
    [
        (DEFAULT + ADVICE, ("advice",), "advice", LINES + 1),
        (DEFAULT + "[[advice]]\n[advice.message]\nno_such_key = []\n", ("advice",), "advice", LINES + 1),
        ("advice = 3" + DEFAULT, ("advice",), "advice", 1),
        (DEFAULT + '[advice.message]\nname = "X"\n', ("advice",), "advice", LINES + 1),
        (DEFAULT + FUSION, ("fusion",), "fusion", LINES + 1),
        (DEFAULT + "[fusion]\npositions_m = 3\nlength = {}\n", ("fusion",), "fusion", LINES + 1),
        (DEFAULT + 'ahead = "AdhesionAhead_A4"\n', ("axle", "ahead"), "axle[4].ahead", LINES + 1),
        (DEFAULT + "ahead = { message = 7, state = [] }\n", ("axle", "ahead"), "axle[4].ahead", LINES + 1),
        (
            DEFAULT + 'detail = { message = "AdhesionDetail_A4", cause = { signal = "Cause", drop_ahead = 31 } }\n',
            ("axle", "detail", "cause", "drop_ahead"),
            "axle[4].detail.cause.drop_ahead",
            LINES + 1,
        ),
    ],
)
def test_configuration_with_an_ended_key_is_the_one_without_it_and_a_warning(
    tmp_path: Path, config: Config, text: str, path: tuple[str, ...], key: str, line: int
) -> None:
    plain, found = (load(tmp_path, t, config) for t in (DEFAULT, text))
    (warning,) = set(found.warnings) - set(plain.warnings)
    assert warning.startswith(f"{tmp_path / 'train.toml'}:{line}: {key}: ")
    assert warning.endswith(ENDED[path])
    assert replace(found, warnings=plain.warnings) == plain


def test_each_ended_key_is_warned_of(tmp_path: Path, config: Config) -> None:
    found = load(tmp_path, DEFAULT + 'ahead = "X"\n' + ADVICE + FUSION, config)
    keys = [key for w in found.warnings for key in ("axle[4].ahead: ", ": advice: ", ": fusion: ") if key in w]
    assert sorted(keys) == [": advice: ", ": fusion: ", "axle[4].ahead: "]


@pytest.mark.parametrize("axle", ["axle = 3\n", "axle = [3]\n", "[axle]\nahead = 3\n"])
def test_mistake_where_an_ended_key_may_stand_is_told_as_without_one(tmp_path: Path, config: Config, axle: str) -> None:
    with pytest.raises(InputErrors) as refused:
        load(tmp_path, axle, config)
    assert any(e.key.startswith("axle") and e.line == 1 for e in refused.value.errors)


def test_ended_key_is_no_key_that_a_mistyped_one_may_mean(tmp_path: Path, config: Config) -> None:
    with pytest.raises(InputError) as refused:
        load(tmp_path, DEFAULT + "[advise]\n", config)
    assert refused.value.key == "advise"
    assert "advice" not in str(refused.value)


def test_check_and_replay_tell_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "train.toml"
    file.write_text((ROOT / "tests/golden/leaf-film.toml").read_text() + ADVICE)
    assert main(["check", "--config", str(file)]) == 0
    said = capsys.readouterr().out
    assert [line for line in said.splitlines() if line.startswith("warning ") and f"{file}:" in line]
    log, out = ROOT / "tests/golden/leaf-film.log", tmp_path / "out.csv"
    assert main(["replay", str(log), "--config", str(file), "--csv", str(out)]) == 0
    assert f"warning: {file}:" in capsys.readouterr().err
    assert out.read_bytes() == (ROOT / "tests/golden/leaf-film.csv").read_bytes()


def test_daemon_starts_and_its_log_tells_of_it(tmp_path: Path) -> None:
    file, log = tmp_path / "train.toml", tmp_path / "log"
    file.write_text(DEFAULT + ADVICE)
    command = (sys.executable, "-m", "wrcd.cli", "run", "-i", "virtual", "-c", "ended", "--config", str(file))
    with log.open("w") as out:
        process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL, stderr=out)
    try:
        wait_for("the daemon", 30, lambda: f"warning: {file}:" in log.read_text())
        assert process.poll() is None
    finally:
        process.terminate()
        process.wait(10)
