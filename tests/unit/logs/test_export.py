"""`wrcd replay --mf4` and `--mcap`, read back with the libraries of the field: values, units, words, times."""

import csv
import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asammdf import MDF
from mcap.reader import make_reader

from sim_ecu.cli.main import main as rig
from tests.support.scenarios import LogOf
from wrcd import __version__, resources
from wrcd.bus.candump import stamp_text
from wrcd.bus.dbc import load_dbc
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.logs import exports
from wrcd.logs.damage import Damage
from wrcd.logs.exports import GatherExports
from wrcd.logs.reader import read_log

GOLDEN = Path(__file__).parents[2] / "golden" / "leaf-film.log"
THIRD_PARTY = Path(__file__).parents[2] / "data/dbc/third-party.toml"
SCENARIO = 'duration_s = 2.5\naxles = [1, 2]\nrail = [{ curve = "C" }]\ndrive = { utilisation = 0.3 }\n'
close = GatherExports.close
Group = dict[str, Any]  # arrays by channel, stamps in µs since 1970 as "time"


def replay(log: Path, *more: object) -> int:
    return main(["replay", str(log), *map(str, more)])


def groups_of(mdf: MDF) -> dict[str, Any]:
    """Channel groups by name, each with its number and channels."""
    every: list[Any] = list(mdf.groups)
    out = {g.channel_group.acq_name: (number, g.channels) for number, g in enumerate(every)}
    assert len(out) == len(every)
    return out


def plain(signal: str) -> str:
    """A signal's name without whose it is."""
    return re.sub(r"(_Changes)?(_A\d)+(_\d)?$", "", signal)


def read_mf4(path: Path) -> dict[str, Group]:
    """Groups by name, with the plain names of their channels."""
    out: dict[str, Group] = {}
    with MDF(path) as mdf:
        header: Any = mdf.header
        for name, (number, of_group) in groups_of(mdf).items():
            channels: Group = {plain(c.name): mdf.get(c.name, group=number).samples for c in of_group}
            channels["time"] = np.round(channels["time"] * 1e6).astype(np.int64) + header.abs_time // 1000
            out[name] = {k: v.astype(str) if v.dtype.kind == "S" else v for k, v in channels.items()}
    return out


def read_mcap(path: Path) -> dict[str, list[dict[str, Any]]]:
    out: dict[str, list[dict[str, Any]]] = {}
    with path.open("rb") as f:
        for _, channel, message in make_reader(f).iter_messages(log_time_order=False):
            assert message.log_time == message.publish_time
            row = json.loads(message.data)
            out.setdefault(channel.topic.removeprefix("/"), []).append({"time": message.log_time // 1000, **row})
    return out


def us(seconds: str) -> int:
    whole, _, decimals = seconds.partition(".")
    return int(whole) * 1_000_000 + int(decimals)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as f:
        return list(csv.DictReader(f))


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with every output of the golden log."""
    folder = tmp_path_factory.mktemp("exported")
    outputs = [("-o", "a.log"), ("--csv", "a.csv"), ("--events", "e.csv"), ("--mf4", "a.mf4"), ("--mcap", "a.mcap")]
    assert replay(GOLDEN, *(word for option, name in outputs for word in (option, folder / name))) == 0
    return folder


def test_mf4_says_what_the_rows_say(exported: Path) -> None:
    table, group = rows(exported / "a.csv"), read_mf4(exported / "a.mf4")["Adhesion_A1"]
    assert group["time"].tolist() == [us(r["time_s"]) for r in table]
    for name, column in (("Validity", "validity"), ("Surface", "surface"), ("Confidence", "confidence")):
        assert group[name].tolist() == [r[column] for r in table]
    said = [r["mu_available_pct"] for r in table]
    assert [f"{x:.2f}" if np.isfinite(x) else "" for x in group["MuAvailable"]] == said
    assert "" in said
    assert len(set(said)) > 30  # on leaf film the memory holds the estimate still


def test_mcap_says_what_the_mf4_says(exported: Path) -> None:
    groups, topics = read_mf4(exported / "a.mf4"), read_mcap(exported / "a.mcap")
    assert topics.keys() == groups.keys()
    for name, group in groups.items():
        for k, row in enumerate(topics[name]):
            for channel, values in group.items():
                if channel in row:
                    assert row[channel] == values[k]
                else:
                    assert np.isnan(values[k])
        assert len(topics[name]) == len(group["time"])


def test_words_of_an_mf4_are_conversions_of_their_numbers(exported: Path) -> None:
    with MDF(exported / "a.mf4") as mdf:
        place = groups_of(mdf)["Adhesion_A1"][0]
        raw, words = mdf.get("Validity_A1", group=place, raw=True), mdf.get("Validity_A1", group=place)
    assert raw.samples.dtype.kind == "i"
    assert set(zip(raw.samples.tolist(), words.samples.tolist(), strict=True)) == {
        (0, b"NotAvailable"), (1, b"Valid"), (2, b"Degraded"),
    }  # fmt: skip


def test_inputs_are_the_accepted_frames_in_si_units(exported: Path) -> None:
    groups, dbc = read_mf4(exported / "a.mf4"), load_dbc(resources.DBC)
    for name, signal, unit in (("YawRate_A1", "YawRate", 1.0), ("Torque_A1", "Torque", 1.0)):
        message = dbc.get_message_by_name(name)
        came = [f for f, _ in read_log(GOLDEN, Damage()) if f.can_id == message.frame_id]
        decoded: list[Any] = [message.decode(f.data) for f in came]
        assert groups[name]["time"].tolist() == [f.stamp_us for f in came]
        assert groups[name][signal] == pytest.approx([float(d[signal]) * unit for d in decoded])
    assert {"LatAccel_A1", "Speed"} < groups.keys()


def test_refused_frame_is_no_value(tmp_path: Path) -> None:
    lines = GOLDEN.read_text().splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if " 101#" in line)
    lines[first] = lines[first].replace(" 101#", " 101#FF", 1)[:-3] + "\n"  # a wrong CRC
    (tmp_path / "bad.log").write_text("".join(lines))
    counts = []
    for log in (GOLDEN, tmp_path / "bad.log"):
        assert replay(log, "--mf4", tmp_path / "a.mf4") == 0
        counts.append(len(read_mf4(tmp_path / "a.mf4")["YawRate_A1"]["time"]))
    assert counts[1] == counts[0] - 1


def test_units_are_those_of_the_field(exported: Path) -> None:
    with MDF(exported / "a.mf4") as mdf:
        units = {name: {plain(c.name): c.unit for c in channels} for name, (_, channels) in groups_of(mdf).items()}
    assert units["YawRate_A1"]["YawRate"] == "rad/s"
    assert units["LatAccel_A1"]["LatAccel"] == "m/s²"
    assert units["Torque_A1"]["Torque"] == "Nm"
    assert units["Speed"]["Speed"] == "m/s"
    assert units["Adhesion_A1"]["MuAvailable"] == "%"
    assert units["AdhesionDetail_A1"]["Residual1"] == "dB"
    with (exported / "a.mcap").open("rb") as f:
        summary = make_reader(f).get_summary()
    assert summary is not None
    channels = {c.topic: c for c in summary.channels.values()}
    assert channels["/Adhesion_A1"].metadata["MuAvailable"] == "%"
    assert {c.message_encoding for c in channels.values()} == {"json"}
    assert {s.encoding for s in summary.schemas.values()} == {"jsonschema"}
    schema = json.loads(summary.schemas[channels["/YawRate_A1"].schema_id].data)
    assert schema["properties"]["YawRate"] == {"type": "number", "description": "rad/s"}


def test_header_says_when_the_log_began_and_what_made_the_values(exported: Path) -> None:
    design, first = load_config(None).design, next(read_log(GOLDEN, Damage()))[0]
    with MDF(exported / "a.mf4") as mdf:
        header: Any = mdf.header
        assert header.abs_time == first.stamp_us * 1000
        assert str(header.start_time) == "2023-11-14 22:13:20.005000+00:00"
        comment = header.comment
    with (exported / "a.mcap").open("rb") as f:
        facts = next(iter(make_reader(f).iter_metadata())).metadata
    for text in (f"wrcd {__version__}", f"{design.name} {design.checksum}", "leaf-film.log"):
        assert text in comment
        assert text in facts.values()
    assert facts["begin_us"] == str(first.stamp_us)


def test_changes_are_the_events(exported: Path) -> None:
    changes = read_mf4(exported / "a.mf4")["Changes_A1"]
    expected = [(us(e["time_s"]), e["to"], e["cause"] or "None", e["detail"]) for e in rows(exported / "e.csv")]
    found = zip(*(changes[c].tolist() for c in ("time", "Validity", "Cause", "Detail")), strict=True)
    assert list(found) == expected
    assert len(expected) > 2


def test_log_of_many_blocks_gives_the_same_values(
    exported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exports, "BLOCK_US", 700_000)
    assert replay(GOLDEN, "--mf4", tmp_path / "b.mf4", "--mcap", tmp_path / "b.mcap") == 0
    one, many = read_mf4(exported / "a.mf4"), read_mf4(tmp_path / "b.mf4")
    assert one.keys() == many.keys()
    for name, group in one.items():
        for channel, values in group.items():
            assert np.array_equal(values, many[name][channel], equal_nan=values.dtype.kind == "f")
    assert read_mcap(exported / "a.mcap") == read_mcap(tmp_path / "b.mcap")


def test_part_of_the_time_and_of_the_axles(log_of: LogOf, tmp_path: Path) -> None:
    log, begin_us = log_of(SCENARIO), 1_700_000_000_000_000
    options = ["--from", begin_us // 1_000_000 + 1, "--to", begin_us // 1_000_000 + 2, "--axle", 2]
    assert replay(log, "--mf4", tmp_path / "a.mf4", *options) == 0
    groups = read_mf4(tmp_path / "a.mf4")
    assert {"Adhesion_A2", "YawRate_A2", "Speed", "WrcdStatus"} < groups.keys()
    assert not any(name.endswith("_A1") for name in groups)
    for group in groups.values():
        assert ((begin_us + 1_000_000 <= group["time"]) & (group["time"] < begin_us + 2_000_000)).all()
    assert len(groups["YawRate_A2"]["time"]) == 200


def test_groups_of_another_trains_dbc_have_our_names(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO)
    log, config = tmp_path / "other.log", ["--config", str(THIRD_PARTY)]
    assert rig(["play", str(tmp_path / "s.toml"), *config, "--no-truth", "--fast", "--log", str(log)]) == 0
    assert replay(log, *config, "--mf4", tmp_path / "a.mf4", "--csv", tmp_path / "a.csv") == 0
    groups, table = read_mf4(tmp_path / "a.mf4"), rows(tmp_path / "a.csv")
    assert {"Adhesion_A1", "Adhesion_A2", "YawRate_A1", "LatAccel_A2", "Speed"} < groups.keys()
    of_first = [r for r in table if r["axle"] == "1"]
    assert groups["Adhesion_A1"]["Validity"].tolist() == [r["validity"] for r in of_first]
    assert "Valid" in groups["Adhesion_A1"]["Validity"]


def test_signals_of_two_axles_in_an_mf4_differ_by_name(log_of: LogOf, tmp_path: Path) -> None:
    assert replay(log_of(SCENARIO), "--mf4", tmp_path / "a.mf4", "--axle", 1, "--axle", 2) == 0
    with MDF(tmp_path / "a.mf4") as mdf:
        of_group = {
            name: [c.name for c in channels if c.name != "time"] for name, (_, channels) in groups_of(mdf).items()
        }
        for axle in (1, 2):
            place = groups_of(mdf)[f"Adhesion_A{axle}"][0]
            found = mdf.get(f"MuAvailable_A{axle}").samples
            assert np.array_equal(found, mdf.get(f"MuAvailable_A{axle}", group=place).samples, equal_nan=True)
    assert {"Torque_A1", "Torque_A2", "Cause_A2", "Speed"} < {name for names in of_group.values() for name in names}
    for axle, other in ((1, 2), (2, 1)):
        own = {name for group, names in of_group.items() if group.endswith(f"_A{axle}") for name in names}
        others = {name for group, names in of_group.items() if not group.endswith(f"_A{axle}") for name in names}
        assert own
        assert not own & others
        assert not any(name.endswith(f"_A{other}") for name in own)


@pytest.mark.parametrize(("extra", "library"), [("mf4", "asammdf"), ("mcap", "mcap")])
def test_missing_extra_is_named_before_anything_is_read(
    extra: str, library: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    out = tmp_path / f"a.{extra}"
    assert replay(GOLDEN, f"--{extra}", out) == 2
    assert f"--{extra}: " in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("extra", ["mf4", "mcap"])
def test_file_begun_of_a_log_that_is_refused_on_the_way_is_removed(
    extra: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = GOLDEN.read_text().splitlines(keepends=True)
    half = len(lines) // 2
    mixed = [line for k in range(0, half, 50) for line in (*lines[half + k : half + k + 50], *lines[k : k + 50])]
    (tmp_path / "mixed.log").write_text("".join([*lines[:200], *mixed]))
    out, begun = tmp_path / f"a.{extra}", []

    def noted(self: GatherExports) -> None:
        begun.append(out.exists())
        close(self)

    monkeypatch.setattr(GatherExports, "close", noted)
    assert replay(tmp_path / "mixed.log", f"--{extra}", out) == 2
    assert "sort it" in capsys.readouterr().err
    assert begun == [True]
    assert not out.exists()


def far(log: Path, seconds: int) -> Path:
    """The first part of the golden log, so many seconds later."""
    lines = GOLDEN.read_text().splitlines(keepends=True)[:400]
    stamps = [round(float(line[1:18]) * 1e6) + 1_000_000 * seconds for line in lines]
    log.write_text("".join(f"({stamp_text(us)}{line[18:]}" for us, line in zip(stamps, lines, strict=True)))
    return log


@pytest.mark.parametrize("seconds", [90_000_000_000, -1_700_000_009], ids=["the year 4875", "before 1970"])
def test_stamps_that_a_format_cannot_hold_end_in_one_line(
    seconds: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What else is written is whole; what was begun of the other is removed."""
    log, table, mcap = far(tmp_path / "far.log", seconds), tmp_path / "a.csv", tmp_path / "a.mcap"
    assert replay(log, "--csv", table, "--mcap", mcap) == 1
    said = capsys.readouterr().err
    assert f"wrcd: error: {mcap}: --mcap: cannot be written: MCAP has no times before 1970 or after 2554\n" in said
    assert not mcap.exists()
    assert len(table.read_text().splitlines()) > 20


def test_mf4_of_stamps_that_it_cannot_hold(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mf4 = tmp_path / "a.mf4"
    assert replay(far(tmp_path / "far.log", 90_000_000_000), "--mf4", mf4) == 1
    assert re.search(r"error: .*a\.mf4: --mf4: cannot be written: ", capsys.readouterr().err)
    assert not mf4.exists()


def test_mf4_of_stamps_before_1970_counts_from_the_first_frame(tmp_path: Path) -> None:
    mf4 = tmp_path / "a.mf4"
    assert replay(far(tmp_path / "far.log", -1_700_000_009), "--mf4", mf4) == 0
    with MDF(mf4) as mdf:
        stamps = mdf.get("YawRate_A1").timestamps
    assert stamps[0] == 0.0
    assert (np.diff(stamps) > 0).all()


@pytest.mark.parametrize("kind", ["mf4", "mcap"])
def test_full_disk_names_the_export(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    full, whole = tmp_path / f"full.{kind}", tmp_path / "whole.csv"
    full.symlink_to("/dev/full")
    assert replay(GOLDEN, f"--{kind}", full, "--csv", whole) == 1
    assert f"wrcd: error: {full}: the output cannot be written to its end: No space left" in capsys.readouterr().err


def test_stamps_that_are_differences_are_said_to_tell_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """can-utils #265: as `candump -L -td` once wrote them."""
    lines = GOLDEN.read_text().splitlines(keepends=True)[:2000]
    log = tmp_path / "delta.log"
    log.write_text("".join(f"(0000000000.000200) {line.partition(' ')[2]}" for line in lines))
    replay(log, "--csv", tmp_path / "a.csv")
    assert f"{log}: nothing is estimated: its frames lie within a tick" in capsys.readouterr().err
