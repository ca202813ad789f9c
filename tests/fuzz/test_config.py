"""Whatever a configuration or a DBC says, it is refused with an InputError or it works, for lint and init, too."""

import contextlib
import tomllib
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.fuzz.strategies import NASTY, mutated
from tests.support.dbc import told
from wrcd import resources
from wrcd.bus.dbc import load_dbc
from wrcd.bus.frame import EXTENDED, Frame
from wrcd.bus.positions import message_key
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.design import load_design
from wrcd.dbc.dbc_lines import read
from wrcd.dbc.init.propose import propose
from wrcd.dbc.lint.lint_file import as_records, findings, lines
from wrcd.errors import InputError

DATA = Path(__file__).parents[1] / "data" / "dbc"
TRAIN_DBC = (DATA / "fuzzed.dbc").read_text()
TRAIN = """
[bus]
interface = "socketcan"
channel = "can0"
[dbc]
file = "train.dbc"
[vehicle]
speed = "Drive.V"
direction = "Drive.Dir"
torque_is_total = true
[limits]
min_speed_m_s = 3.0
not_available_after_ms = 100
[wheelset]
m_w = 1250.0
[[axle]]
number = 1
yaw_rate = "Bogie1.Gyro"
lateral_acceleration = "Bogie1.Side"
torque = "Bogie1.Tractive"
brake_torque = "Bogie1.Brake"
axle_load = "Drive.Load"
wheel_radius = "Wheel.Radius"
adhesion = "Adhesion_A1"
"""
PACKAGED = """
[vehicle]
speed = "VehicleSpeed.Speed"
status_message = "WrcdStatus"
[limits]
min_speed_m_s = 20
[estimator]
[[axle]]
number = 2
yaw_rate = "YawRate_A2.YawRate"
lateral_acceleration = "LatAccel_A2.LatAccel"
torque = "Torque_A2.Torque"
adhesion = "Adhesion_A2"
detail = "AdhesionDetail_A2"
[[axle]]
number = 1
yaw_rate = "YawRate_A1.YawRate"
lateral_acceleration = "LatAccel_A1.LatAccel"
torque = "Torque_A1.Torque"
"""
KEYS = (
    "bus", "dbc", "vehicle", "limits", "estimator", "wheelset", "axle", "interface", "channel", "file", "speed",
    "direction", "torque_is_total", "status_message", "min_speed_m_s", "not_available_after_ms", "constant_speed_m_s",
    "design", "m_w", "number", "yaw_rate", "torque", "adhesion", "detail",
)  # fmt: skip
START_US = 1_700_000_000_000_000


DESIGN, PACKAGED_DBC = load_design(resources.DESIGN), load_dbc(resources.DBC)


def load(path: Path) -> Config:
    """As the daemon loads it; what comes with the package is read once for all examples."""
    with patch.multiple(
        "wrcd.config.config",
        load_dbc=lambda p, encoding: PACKAGED_DBC if p == resources.DBC else load_dbc(p, None, encoding),
        load_design=lambda p: DESIGN if p == resources.DESIGN else load_design(p),
    ):
        return load_config(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("config")


def works_or_says_why(path: Path, payloads: list[bytes]) -> None:
    try:
        config = load(path)
    except InputError:
        return
    survives(config, payloads)


def survives(config: Config, payloads: list[bytes]) -> None:
    """The core made of it takes any bytes on its ids, and what it sends is as long as the DBC says."""
    core = Core(config)
    lengths = {message_key(m): m.length for m in config.database.messages}
    fed = 0
    for k, payload in enumerate(payloads):
        for key in core.mapped.keys:
            data = (payload * 64)[: lengths[key]] if payload else bytes(lengths[key])
            frame = Frame(START_US + 7_000 * k, key & ~EXTENDED, data, extended=bool(key & EXTENDED))
            for o in core.feed(frame):
                assert len(o.frame.data) == lengths[o.frame.key]
            fed += 1
    core.advance(START_US + 7_000 * len(payloads) + 300_000)
    core.shutdown_frames(START_US)
    assert core.counts.accepted + sum(core.counts.rejected.values()) == fed


PAYLOADS = st.lists(st.binary(max_size=8), max_size=6)


def test_texts_before_mutation_are_good(folder: Path) -> None:
    (folder / "train.dbc").write_text(TRAIN_DBC)
    for name, text in (("train.toml", TRAIN), ("packaged.toml", PACKAGED)):
        (folder / name).write_text(text)
        survives(load(folder / name), [b"", b"\x01", b"\xff"])


@given(text=mutated(TRAIN_DBC), payloads=PAYLOADS)
def test_mutated_dbc_works_or_is_rejected(folder: Path, text: str, payloads: list[bytes]) -> None:
    (folder / "train.dbc").write_text(text, "utf-8")
    (folder / "wrcd.toml").write_text(TRAIN, "utf-8")
    works_or_says_why(folder / "wrcd.toml", payloads)


@given(text=mutated(TRAIN_DBC), names=st.sets(st.sampled_from(("Bogie1", "Drive", "Wheel", "Adhesion_A1"))))
def test_a_subset_of_a_mutated_dbc_tells_the_same_of_what_is_needed(folder: Path, text: str, names: set[str]) -> None:
    (folder / "some.dbc").write_text(text, "utf-8")
    try:
        whole = load_dbc(folder / "some.dbc")
    except InputError:
        return
    some = {m.name: m for m in load_dbc(folder / "some.dbc", names).messages}
    for m in whole.messages:
        if m.name in names:
            assert told(m) == told(some[m.name])


@given(text=mutated(TRAIN), payloads=PAYLOADS)
def test_mutated_mapping_works_or_is_rejected(folder: Path, text: str, payloads: list[bytes]) -> None:
    (folder / "train.dbc").write_text(TRAIN_DBC, "utf-8")
    (folder / "wrcd.toml").write_text(text, "utf-8")
    works_or_says_why(folder / "wrcd.toml", payloads)


@example(PACKAGED.replace("= 20", "= 1e308"), [b""])
@example(PACKAGED.replace("= 20", f"= {10**400}"), [b""])
@example(PACKAGED.replace("= 20", "= " + "9" * 5000), [b""])
@given(text=mutated(PACKAGED), payloads=PAYLOADS)
def test_mutated_configuration_works_or_is_rejected(folder: Path, text: str, payloads: list[bytes]) -> None:
    (folder / "wrcd.toml").write_text(text, "utf-8")
    works_or_says_why(folder / "wrcd.toml", payloads)


@given(content=st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_arbitrary_configuration_is_rejected(folder: Path, content: bytes) -> None:
    (folder / "wrcd.toml").write_bytes(content)
    with pytest.raises(InputError):
        load(folder / "wrcd.toml")


def toml(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + "}"
    return "[" + ", ".join(map(toml, value)) + "]" if isinstance(value, list) else str(value)


LEAVES = (
    st.sampled_from(
        [*NASTY, '"VehicleSpeed.Speed"', '"YawRate_A1.YawRate"', '"."', "1", "3.0", "2024-01-01", "07:30:00"]
    )
    | st.integers().map(str)
    | st.floats().map(lambda x: repr(x).replace("+", ""))
)
VALUES = st.recursive(
    LEAVES, lambda v: st.lists(v, max_size=3) | st.dictionaries(st.sampled_from(KEYS), v, max_size=3), max_leaves=5
)


@given(document=st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=6), payloads=PAYLOADS)
def test_known_keys_with_any_values_work_or_are_rejected(
    folder: Path, document: dict[str, Any], payloads: list[bytes]
) -> None:
    text = "\n".join(f"{k} = {toml(v)}" for k, v in document.items())
    (folder / "wrcd.toml").write_text(text, "utf-8")
    works_or_says_why(folder / "wrcd.toml", payloads)


DBCS = tuple((DATA / name).read_text("cp1252") for name in ("sound.dbc", "third-party.dbc"))


@given(st.sampled_from(DBCS).flatmap(mutated))
def test_lint_and_init_of_a_mutated_dbc_work_or_say_why(folder: Path, text: str) -> None:
    file = folder / "lint.dbc"
    file.write_text(text, encoding="utf-8", newline="")
    last = text.count("\n") + text.count("\r") + 1
    with contextlib.suppress(InputError):
        found = findings(file, DESIGN)
        assert all(1 <= f.line <= last for f in found)
        assert len(lines(file, found)) > len(found)
        assert as_records(file, found)["file"] == str(file)
    with contextlib.suppress(InputError):
        tomllib.loads(propose(read(file), folder, DESIGN).text())
