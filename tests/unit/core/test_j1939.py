"""A mapping that asks for a parameter group: whoever sends it, at whatever priority, and one sender at a time."""

import re
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from sim_ecu.cli.main import main as sim_ecu
from tests.support.dbc import database
from wrcd.bus.frame import EXTENDED, GROUP, Frame, mask_of
from wrcd.bus.pythoncan import PythonCanLink
from wrcd.bus.rawcan import FILTER, only_word
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.core.reading import Receiver, Sample
from wrcd.errors import InputError
from wrcd.logs.feed import survey
from wrcd.logs.story import gather
from wrcd.monitor.sources import model_of_log

OWN = Path(__file__).parents[3] / "examples/own-dbc"
RIDE = 'duration_s = 4\nrail = [{ curve = "C" }]\ndrive = { utilisation = 0.3 }\n'
SPEED = 0x18FE6E0B  # the group of the speed in the DBC: priority 6, source address 11
OTHER = 0x0CFE6E33  # of the same, at priority 3 from address 51


def train(folder: Path, keys: str) -> Path:
    """The example's train with its speed in J1939."""
    dbc, toml = ((OWN / name).read_text() for name in ("train.dbc", "train.toml"))
    (folder / "train.dbc").write_text(re.sub(r"\b560\b", str(SPEED | 1 << 31), dbc))
    config = folder / "train.toml"
    config.write_text(toml.replace('"BCU_Speed.V"', f'{{ signal = "BCU_Speed.V"{keys} }}'))
    return config


def ridden(config: Path, *can_ids: int) -> Path:
    """The log of a ride whose speed is sent under these ids of the group, one after the other."""
    log = config.parent / "ride.log"
    (config.parent / "ride.toml").write_text(RIDE)
    ride = ["play", str(config.parent / "ride.toml"), "--config", str(config), "--no-truth", "--fast"]
    assert sim_ecu([*ride, "--log", str(log)]) == 0
    before, *speeds = re.split(rf" {SPEED:08X}(?=#)", log.read_text())
    named = (f" {can_ids[k % len(can_ids)]:08X}{rest}" for k, rest in enumerate(speeds))
    log.write_text("".join([before, *named]))
    return log


def replayed(config: Path, *can_ids: int) -> bytes:
    """The rows that come of it."""
    log, out = ridden(config, *can_ids), config.parent / "out.csv"
    assert main(["replay", str(log), "--config", str(config), "--csv", str(out)]) == 0
    return out.read_bytes()


@pytest.mark.parametrize(("keys", "can_id"), [("", SPEED), (", pgn = true", SPEED), (", pgn = true", OTHER)])
def test_group_is_read_whoever_sends_it(keys: str, can_id: int, tmp_path: Path) -> None:
    (tmp_path / "plain").mkdir()
    rows = replayed(train(tmp_path, keys), can_id)
    assert rows.count(b",Valid,") > 100
    assert rows == replayed(train(tmp_path / "plain", ""), SPEED)


def test_sender_that_is_not_the_dbcs_is_not_read_unless_the_mapping_asks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert b",Valid," not in replayed(train(tmp_path, ""), OTHER)
    assert main(["check", "--config", str(train(tmp_path, ", pgn = true"))]) == 0
    assert "0x18FE6E0B of any sender BCU_Speed.V" in capsys.readouterr().out


def test_two_senders_at_once_are_two_senders(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = replayed(train(tmp_path, ", pgn = true"), SPEED, SPEED, OTHER)
    assert b",Valid," not in rows
    assert b"two senders sent the same message" in rows
    assert "rejected: 198 two senders" in capsys.readouterr().err  # all but the first two


def test_story_monitor_and_check_of_a_log_have_the_group_as_their_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = train(tmp_path, ", pgn = true")
    log = ridden(config, OTHER)
    story = gather(log, load_config(config))
    assert {m.key: m.role for m in story.bus.messages if m.name == "BCU_Speed"} == {SPEED | EXTENDED: "input"}
    assert story.speed is not None
    assert len(story.speed.time_us) == 200
    model, _ = model_of_log(log, load_config(config), (), None, 500_000)
    (speed,) = [i for i in model.inputs_at(model.axles[0], story.end_us) if i.quantity is Quantity.SPEED]
    assert speed.rate_hz == pytest.approx(50.0, abs=5.0)
    assert main(["check", "--config", str(config), "--log", str(log)]) == 0
    assert "BCU_Speed" in capsys.readouterr().out


def test_frame_of_an_axles_group_is_one_of_the_axle(tmp_path: Path) -> None:
    config, log = train(tmp_path, ""), tmp_path / "one.log"
    dbc, toml = tmp_path / "train.dbc", config.read_text()
    dbc.write_text(re.sub(r"\b513\b", str(0x18FF0001 | 1 << 31), dbc.read_text()))
    config.write_text(toml.replace('"Bogie1.GyroZ"', '{ signal = "Bogie1.GyroZ", pgn = true }'))
    log.write_text("(1.000000) can0 18FF0002#00000000\n")
    assert survey(log, load_config(config), None).without_frame == frozenset()


GROUPS = """
BO_ 2566844704 Speed: 3 B
 SG_ V : 0|16@1+ (0.01,0) [0|300] "km/h" B
 SG_ Status : 16|8@1+ (1,0) [0|255] "" B
BO_ 2364483360 Torque: 2 B
 SG_ T : 0|16@1- (1,0) [-30000|30000] "Nm" B
"""
BROADCAST, ADDRESSED = 0x18FEF120, 0x0CEF2720  # the one's PDU format has no destination, the other's is lower


def receiver() -> Receiver:
    state = StatusRule("Speed", "Status", frozenset({0}), frozenset())
    speed = Source("Speed", "V", Quantity.SPEED, (0,), factor=1.0, statuses=(state,), pgn=True)
    torque = Source("Torque", "T", Quantity.TORQUE, (0,), pgn=True)
    return Receiver(database(GROUPS), [speed, torque])


@pytest.mark.parametrize(
    ("can_id", "extended", "number"),
    [
        (BROADCAST, True, 0),
        (0x00FEF1FE, True, 0),
        (BROADCAST ^ 1 << 8, True, None),  # another group
        (BROADCAST ^ 1 << 24, True, None),  # the other data page
        (BROADCAST & 0x7FF, False, None),
        (0x18EF0003, True, 1),  # for another receiver
        (ADDRESSED ^ 1 << 16, True, None),
    ],
)
def test_group_is_told_by_format_and_page(can_id: int, extended: bool, number: int | None) -> None:
    data = bytes(2 + (number == 0))
    got = receiver().read(Frame(0, can_id, data, extended))
    assert got == (None if number is None else [Sample(number, 0.0)])


@pytest.mark.parametrize("base", [BROADCAST, ADDRESSED, ADDRESSED & ~0xFF])
@pytest.mark.parametrize(
    ("pattern", "refused"),
    [
        ("A" * 4 + "B" * 17 + "A", "." * 4 + "x" * 15 + ".." + "x"),  # a new sender is believed after a while
        ("AAB" + "A" * 16, "..x" + "x" * 15 + "."),
        ("ABBBABBBABBB", ".xxxxxxxxxxx"),
        ("AAABBBAAABBB", "...xxxxxxxxx"),
    ],
)
def test_new_sender_is_believed_when_it_has_been_alone(base: int, pattern: str, refused: str) -> None:
    r, data = receiver(), bytes(2 + (base == BROADCAST))
    got = [r.read(Frame(0, base ^ (sender == "B"), data, True)) for sender in pattern]
    assert "".join("x" if one is Reason.TWO_SENDERS else "." for one in got) == refused


def test_priority_and_receiver_make_no_other_sender() -> None:
    r = receiver()
    for can_id in (ADDRESSED, ADDRESSED ^ 0x1000_0000, ADDRESSED ^ 0x0500, ADDRESSED):
        assert r.read(Frame(0, can_id, bytes(2), True)) == [Sample(1, 0.0)]


@pytest.mark.parametrize("pattern", ["AAABBB", "ABBB", "AABB", "ABAA", "AAB"])
def test_two_senders_within_a_tick_are_never_valid(pattern: str, tmp_path: Path) -> None:
    """A gateway sends many frames at once."""
    config = train(tmp_path, ", pgn = true")
    log = ridden(config, SPEED)
    lines = []
    for line in log.read_text().splitlines():
        stamp, rest = line[1:].split(")", 1)
        named = [rest.replace(f"{SPEED:08X}", f"{SPEED if x == 'A' else OTHER:08X}") for x in pattern]
        at = int(stamp.replace(".", ""))
        times = [f"{(at + 20 * k) // 1_000_000}.{(at + 20 * k) % 1_000_000:06d}" for k in range(len(pattern))]
        same = f"{SPEED:08X}" not in rest
        lines += [line] if same else [f"({t}){r}" for t, r in zip(times, named, strict=True)]
    log.write_text("\n".join(lines) + "\n")
    out = tmp_path / "out.csv"
    assert main(["replay", str(log), "--config", str(config), "--csv", str(out)]) == 0
    rows = out.read_bytes()
    assert b",Valid," not in rows
    assert b"two senders sent the same message" in rows


@pytest.fixture
def bus() -> Iterator[can.BusABC]:
    with can.Bus("groups", interface="virtual") as bus:
        yield bus


def test_link_lets_in_the_groups(bus: can.BusABC) -> None:
    keys = receiver().mapped.keys
    assert keys == (ADDRESSED | EXTENDED | GROUP, BROADCAST | EXTENDED | GROUP)
    link = PythonCanLink("virtual", "groups", keys)
    ids = [BROADCAST, BROADCAST ^ 0x1000_0003, BROADCAST ^ 0x100, ADDRESSED ^ 0x103, 0x123]
    for can_id in ids:
        bus.send(can.Message(arbitration_id=can_id, is_extended_id=can_id > 0x7FF))
    assert [f.can_id for f in link.receive(0)] == [ids[0], ids[1], ids[3]]
    link.close()
    for key in keys:
        word, mask = FILTER.unpack(only_word(key))
        assert (word, mask) == (key & ~GROUP, mask_of(key))


def test_message_within_a_group_that_is_read_whole_is_refused(tmp_path: Path) -> None:
    config = train(tmp_path, ", pgn = true")
    dbc = tmp_path / "train.dbc"
    dbc.write_text(re.sub(r"\b545\b", str(OTHER | 1 << 31), dbc.read_text()))
    with pytest.raises(InputError, match=r"has the extended id 0x18FE6E0B, and .* is of its group"):
        load_config(config)
