"""What frames say, decoded many at once: as it was written, and as cantools reads it."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.resources import TRUTH_DBC
from wrcd.bus.dbc import find_message, load_dbc
from wrcd.bus.writers import Value, Writer
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.vocabulary import MESSAGES, Numeric, Words
from wrcd.logs.decoder import UNKNOWN, MessageDecoder, decoders, sent_messages

ROOT = Path(__file__).parents[3]
EXAMPLES = [f for f in sorted((ROOT / "examples").glob("*.toml")) if "[[axle]]" in f.read_text(encoding="utf-8")]
CONFIGS = [None, *sorted((ROOT / "tests/data/dbc").glob("*.toml")), *EXAMPLES]
RNG = np.random.default_rng(3)


def drawn(kind: str) -> dict[str, Value]:
    """A value for each of a message's signals: a word, a number within its range, or none."""
    out: dict[str, Value] = {}
    for name, said_of in MESSAGES[kind].items():
        if isinstance(said_of, Words):
            out[name] = str(RNG.choice(said_of.words))
        elif said_of.absent and RNG.random() < 0.2:
            out[name] = None
        else:
            number = RNG.uniform(said_of.low, said_of.high)
            out[name] = float(round(number)) if said_of.exact else float(number)
    return out


def writer_of(config: Config, decoder: MessageDecoder) -> Writer:
    (output,) = [o for _, _, o in sent_messages(config) if o.message == decoder.name]
    return Writer(find_message(config.database, output.message), output)


@pytest.mark.parametrize("file", CONFIGS, ids=lambda f: "packaged" if f is None else f.stem)
def test_frames_say_what_was_written_into_them(file: Path | None) -> None:
    config = load_config(file)
    found = list(decoders(config))
    assert found
    for decoder in found:
        assert decoder.kind
        writer = writer_of(config, decoder)
        written = [drawn(decoder.kind) for _ in range(40)]
        frames = [writer.frame(0, k, values).data for k, values in enumerate(written)]
        read = decoder.read(np.array([list(f) for f in frames], np.uint8))
        assert set(read) == set(decoder.names)
        for name, column in read.items():
            told = MESSAGES[decoder.kind][name]
            for k, values in enumerate(written):
                agrees(told, values[name], column[k], writer, name)


def agrees(told: Numeric | Words, value: Value, read: Any, writer: Writer, name: str) -> None:
    """A number may differ by a step of ours; of words that a frame does not tell apart the first is read."""
    if isinstance(told, Words):
        data = writer.frame(0, 0, {name: value}).data
        assert told.words[int(read)] == next(w for w in told.words if writer.frame(0, 0, {name: w}).data == data)
    elif value is None:
        assert math.isnan(read)
    else:
        assert isinstance(value, float)
        assert read == pytest.approx(value, abs=1e-9 if told.exact else told.step)


def test_every_other_dbc_is_read_by_its_own_names() -> None:
    database = load_dbc(TRUTH_DBC)
    message = find_message(database, "SimTruth_A3")
    values = {"Crc": 0, "Counter": 3, "Status": 0, "MuAvailable": 38.39, "MuUsed": 2.5, "Slip": -0.01}
    data = message.encode(values, strict=False)
    read = MessageDecoder(message).read(np.array([list(data)] * 3, np.uint8))
    assert read["MuAvailable"] == pytest.approx([38.39] * 3)
    assert read["Slip"] == pytest.approx([-0.01] * 3)


def test_value_beyond_its_range_is_nan_and_an_unknown_word_is_told(config: Config) -> None:
    decoder = next(s for s in decoders(config) if s.name == "Adhesion_A1")
    data = np.zeros((2, 8), np.uint8)
    data[0, 1], data[1, 1] = 0x70, 0x10  # Validity 7, which there is not, and Valid
    data[0, 2:4] = 0x11, 0x27  # 100.01 %
    data[1, 2:4] = 0xFE, 0xFF  # Error
    read = decoder.read(data)
    assert read["Validity"].tolist() == [UNKNOWN, 1]
    assert np.isnan(read["MuAvailable"]).all()


def test_no_frames_are_no_values(config: Config) -> None:
    for decoder in decoders(config):
        assert {len(column) for column in decoder.read(np.zeros((0, 8), np.uint8)).values()} <= {0}
