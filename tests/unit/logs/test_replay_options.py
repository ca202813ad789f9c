"""What of a log `wrcd replay` reads, and what of its outcome it writes."""

import csv
import re
from pathlib import Path

import can
import pytest

from wrcd.cli.main import main
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

GOLDEN = Path(__file__).parents[2] / "golden" / "leaf-film.log"
LINES = GOLDEN.read_text().splitlines(keepends=True)
BEGIN_S = 1_700_000_000
CYCLE_US = 20_000  # of Adhesion
Row = dict[str, str]


def replay(log: Path, *more: str) -> tuple[int, list[Row]]:
    out = log.with_suffix(".rows")
    status = main(["replay", str(log), "--csv", str(out), *more])
    with out.open(newline="") as f:
        return status, list(csv.DictReader(f))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "a.log"
    path.write_text("".join(LINES))
    return path


def moved(line: str, us: int) -> str:
    stamp_us = int(line[1:11]) * 1_000_000 + int(line[12:18]) + us
    return f"({stamp_us // 1_000_000:010d}.{stamp_us % 1_000_000:06d}){line[19:]}"


def of_axle_2(line: str) -> str:
    """A frame of axle 2, which its checks refuse: its CRC is of another id."""
    return re.sub(r" 1([012])1#", r" 1\g<1>2#", line)


def test_part_of_the_time_gives_the_rows_of_the_whole(log: Path) -> None:
    whole = replay(log)[1]
    status, part = replay(log, "--from", str(BEGIN_S + 2), "--to", str(BEGIN_S + 3.5))
    assert status == 0
    assert part == [r for r in whole if BEGIN_S + 2 <= float(r["time_s"]) < BEGIN_S + 3.5]
    assert len(part) == 75


def test_relative_times_count_from_the_logs_first_frame(log: Path) -> None:
    whole = replay(log)[1]
    first = read_first(log)
    part = replay(log, "--relative", "--from", "2", "--to", "3.5")[1]
    expected = [r for r in whole if first + 2_000_000 <= us(r) < first + 3_500_000]
    assert [us(r) + first for r in part] == [us(r) for r in expected]
    assert [{**r, "time_s": ""} for r in part] == [{**r, "time_s": ""} for r in expected]


def read_first(log: Path) -> int:
    return next(read_log(log, Damage()))[0].stamp_us


def us(row: Row) -> int:
    seconds, _, decimals = row["time_s"].partition(".")
    return int(seconds) * 1_000_000 + int(decimals)


def test_reading_ends_a_second_behind_the_end(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log.write_text("".join(moved(line, 5_000_000 * k) for k in range(12) for line in LINES))
    replay(log, "--to", str(BEGIN_S + 1))
    read = int(re.findall(r"(\d+) frames read", capsys.readouterr().err)[0])
    assert read < 8 * len(LINES)  # of twelve: a part of a buffer behind it, and what is looked ahead to


@pytest.mark.parametrize("axles", [("1",), ("2",), ("1", "2")])
def test_wanted_axles_are_written_alone(log: Path, axles: tuple[str, ...], tmp_path: Path) -> None:
    out = tmp_path / "sent.log"
    _, rows = replay(log, *(a for n in axles for a in ("--axle", n)), "-o", str(out))
    assert {r["axle"] for r in rows} == set(axles)
    sent = {f.can_id for f, _ in read_log(out, Damage())}
    assert {i - 0x90 for i in sent if 0x90 < i <= 0x98} == set(map(int, axles))
    assert {i - 0xA0 for i in sent if 0xA0 < i < 0xA8} == set(map(int, axles))
    assert 0xB0 in sent


def test_axle_without_a_frame_has_no_rows_and_is_named(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, rows = replay(log)
    assert status == 0
    assert {r["axle"] for r in rows} == {"1"}
    assert "has no frame of axle 2, 3, 4; no rows of it" in capsys.readouterr().err
    lines = log.read_text().splitlines(keepends=True)
    at = next(k for k, line in enumerate(lines) if of_axle_2(line) != line and k > 2500)
    lines[at] = of_axle_2(lines[at])
    log.write_text("".join(lines))
    assert {r["axle"] for r in replay(log)[1]} == {"1", "2"}
    assert "has no frame of axle 3, 4; no rows of it" in capsys.readouterr().err


def test_log_of_several_channels_needs_one_named(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = replay(log)[1]
    other = [moved(line, 1000).replace("can0", "can1") for line in LINES]
    log.write_text("".join(sorted((*LINES, *other))))
    capsys.readouterr()
    assert main(["replay", str(log), "--csv", str(log.with_suffix(".csv"))]) == 2
    assert f"has several channels: can0 ({len(LINES)} frames), can1 ({len(LINES)} frames)" in capsys.readouterr().err
    assert not log.with_suffix(".csv").exists()
    assert replay(log, "--channel", "can0") == (0, whole)
    assert main(["replay", str(log), "--channel", "vcan7"]) == 2


def test_second_channel_late_in_a_log_leaves_no_output(log: Path, tmp_path: Path) -> None:
    both = [line + line.replace(" 101#", " 102#").replace(" 111#", " 112#") for line in LINES]
    log.write_text("".join(both) + moved(LINES[-1], 1000).replace("can0", "can1"))
    out = tmp_path / "sent.log"
    assert main(["replay", str(log), "-o", str(out)]) == 2
    assert not out.exists()


def test_log_out_of_order_gives_the_rows_of_the_sorted_one(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = replay(log)[1]
    parts = [LINES[k : k + 300] for k in range(0, len(LINES), 300)]
    log.write_text("".join(line for part in parts for line in sorted(part, key=lambda line: line[25:28])))
    status, rows = replay(log)
    assert status == 0
    assert rows == whole
    assert f"{log}: out of time order" in capsys.readouterr().err


def test_asc_keeps_the_times_between_frames(log: Path, tmp_path: Path) -> None:
    asc = tmp_path / "b.asc"
    with can.Logger(asc) as logger, can.LogReader(GOLDEN) as reader:
        for message in reader:
            logger.on_message_received(message)
    frames = [f for f, _ in read_log(asc, Damage())]
    first = read_first(GOLDEN)
    expected = [f.stamp_us - first for f, _ in read_log(GOLDEN, Damage())]
    assert max(abs(f.stamp_us - frames[0].stamp_us - e) for f, e in zip(frames, expected, strict=True)) <= 1
    status, rows = replay(asc, "--relative")
    assert status == 0
    assert sum(r["validity"] == "Valid" for r in rows) > 50
    apart_us = [abs(us(a) - us(b)) for a, b in zip(rows, replay(log, "--relative")[1], strict=False)]
    assert len(apart_us) > 100
    assert 0 < max(apart_us) < CYCLE_US


@pytest.mark.parametrize(
    ("options", "keys"),
    [
        (("--csv", "a.csv", "--events", "a.csv"), "--csv and --events"),
        (("--csv", "b.csv", "-o", "b.csv"), "-o and --csv"),
        (("--csv", "b.csv", "-o", "sub/../b.csv"), "-o and --csv"),
        (("--events", "b.csv", "-o", "link.csv"), "-o and --events"),
        (("--events", "old.csv", "--csv", "hard.csv"), "--csv and --events"),
    ],
)
def test_one_file_for_two_outputs_is_refused_before_anything_is_written(
    options: tuple[str, ...], keys: str, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = log.parent
    (folder / "sub").mkdir()
    (folder / "link.csv").symlink_to("b.csv")
    (folder / "old.csv").write_text("kept")
    (folder / "hard.csv").hardlink_to(folder / "old.csv")
    named = [o if o.startswith("-") else str(folder / o) for o in options]
    assert main(["replay", str(log), *named]) == 2
    assert keys in capsys.readouterr().err
    assert not (folder / "a.csv").exists()
    assert not (folder / "b.csv").exists()
    assert (folder / "old.csv").read_text() == "kept"


def test_output_that_is_the_configuration_is_refused(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "my.toml"
    config.write_text("# mine\n")
    assert main(["replay", str(log), "--config", str(config), "--csv", f"{tmp_path}/./my.toml"]) == 2
    assert "my.toml: is the configuration" in capsys.readouterr().err
    assert config.read_text() == "# mine\n"


def test_device_takes_two_outputs(log: Path) -> None:
    assert main(["replay", str(log), "--csv", "/dev/null", "-o", "/dev/null"]) == 0


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (
            ("--from", "5", "--to", "5.1"),
            "--to: 5.100000 s lies before the whole log, which goes from {begin} to {end}",
        ),
        (("--to", str(BEGIN_S)), f"--to: {BEGIN_S}.000000 s lies before the whole log"),
        (("--from", str(BEGIN_S + 100)), "--from: 1700000100.000000 s lies behind the whole log"),
        (
            ("--from", "100", "--relative"),
            "--from: 100.000000 s lies behind the whole log, which goes from 0.000000 to {length} s",
        ),
        (("--to", "0", "--relative"), "--to: 0.000000 s lies before the whole log, which goes from 0.000000 to"),
    ],
)
def test_time_outside_of_the_log_is_an_error_with_the_logs_own(
    options: tuple[str, ...], reason: str, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, sent = log.with_suffix(".csv"), log.with_suffix(".sent")
    assert main(["replay", str(log), "--csv", str(out), "-o", str(sent), *options]) == 2
    stamps = [f.stamp_us for f, _ in read_log(log, Damage())]
    begin, end, length = (f"{t * 1e-6:.6f}" for t in (stamps[0], stamps[-1], stamps[-1] - stamps[0]))
    said = capsys.readouterr().err
    assert reason.format(begin=begin, end=end, length=length) in said
    assert ("with --relative they count" in said) == ("--relative" not in options)
    assert not out.exists()
    assert not sent.exists()


@pytest.mark.parametrize("folder", [".", "..", "/", "", "a.asc"])
@pytest.mark.parametrize("command", [["replay"], ["dump"], ["check", "--log"]])
def test_folder_is_no_log(
    command: list[str], folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.asc").mkdir()
    assert main([*command, folder]) == 2
    assert capsys.readouterr().err.startswith(f"wrcd: error: {Path(folder)}: ")


def test_from_a_day_before_the_log_is_all_of_it(log: Path) -> None:
    whole = replay(log)[1]
    assert replay(log, "--from", str(BEGIN_S - 86_400)) == (0, whole)
    assert replay(log, "--from", "0") == (0, whole)
