"""The frames that the plug-in plays, read by code that is not wrcd's."""

from pathlib import Path

import e2e.p11
import pytest

from sim_ecu.play.train import AdhesionReader
from tests.support.contract import EXAMPLES
from tests.support.kit.trains import odd_train
from tests.support.processes import ROOT
from wrcd.bus.dbc import find_message
from wrcd.config.config import load_config
from wrcd.contract.frames import BASE, NOTHING, FrameMaker, Says
from wrcd.core.configuration import Config

THIRD = ROOT / "tests" / "data" / "dbc" / "third-party.toml"
OWN = EXAMPLES / "own-dbc" / "train.toml"


def made(path: Path | None) -> tuple[Config, FrameMaker, AdhesionReader]:
    config = load_config(path)
    axle = config.axles[0]
    return (
        config,
        FrameMaker(config, axle),
        AdhesionReader(find_message(config.database, axle.adhesion.message), axle.adhesion),
    )


@pytest.mark.parametrize("path", [None, THIRD, OWN], ids=["default", "third-party", "own-dbc"])
def test_frame_says_what_was_asked_for(path: Path | None) -> None:
    _, maker, reader = made(path)
    said = reader.read(maker.frame(3, BASE).data)
    assert said["Validity"] == "Valid"
    assert said["MuAvailable"] == pytest.approx(20.0, abs=0.5)
    assert said.get("Confidence", "Within3pp") == "Within3pp"
    assert said.get("SampleAge", 10.0) == pytest.approx(10.0, abs=5.0)
    nothing = reader.read(maker.frame(3, NOTHING).data)
    assert (nothing["Validity"], nothing["MuAvailable"]) == ("NotAvailable", None)


def test_protected_frame_passes_an_independent_check(config: Config) -> None:
    maker = FrameMaker(config, config.axles[1])
    frame = maker.frame(17, BASE)
    assert frame.can_id == 0x092
    assert (frame.data[1] & 0x0F) == 17 % 15
    assert e2e.p11.e2e_p11_check(bytearray(frame.data), 0x092)
    other = maker.again(frame, other_message=True)
    assert not e2e.p11.e2e_p11_check(bytearray(other.data), 0x092)


def test_tampered_value_leaves_the_rest_and_has_a_right_crc(config: Config) -> None:
    _, maker, reader = made(None)
    frame = maker.with_raw(maker.frame(4, BASE), "Validity", 15)
    assert frame.data[1] == 15 << 4 | 4
    assert reader.read(frame.data)["MuAvailable"] == 20.0
    assert e2e.p11.e2e_p11_check(bytearray(frame.data), 0x091)


def test_lower_end_is_what_a_receiver_can_know() -> None:
    _, maker, _ = made(None)
    assert maker.lower_end(Says(20.0, "Within3pp")) == pytest.approx(17.0)
    assert maker.lower_end(Says(5.0, "Within12pp")) == 0.0
    _, eight_bits, _ = made(THIRD)
    assert eight_bits.lower_end(Says(20.3, "Within1pp")) == pytest.approx(19.0)  # rounded down to 20


def test_time_out_is_the_shortest_that_the_dbc_states_or_three_cycles(tmp_path: Path) -> None:
    assert [made(path)[1].timeout_us for path in (None, THIRD, OWN)] == [60_000, 60_000, 60_000]
    assert made(odd_train(tmp_path))[1].timeout_us == 90_000  # of MuAvailable: Validity states none, the cycle is 40 ms


def test_values_that_mean_no_number_are_known(config: Config) -> None:
    maker = FrameMaker(config, config.axles[0])
    kinds = {(kind, raw) for kind, _, raw in maker.no_numbers()}
    assert kinds == {("not-available", 65535), ("error", 65534), ("beyond", 10001), ("beyond", 37768)}
    assert [raw for _, raw in maker.unknown_validities()] == [15]
    third = FrameMaker(load_config(THIRD), load_config(THIRD).axles[0])
    assert next(name for name, _ in third.unknown_validities()) == "Error"
    assert ("not-available", 255) in {(kind, raw) for kind, _, raw in third.no_numbers()}
