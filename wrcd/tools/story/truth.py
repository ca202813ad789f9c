"""What a rig says of the adhesion, read through a second DBC: messages SimTruth_A1 … with MuAvailable and MuUsed."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wrcd.bus.codec import message_key
from wrcd.bus.dbc import Database, Message, data_id, load_dbc
from wrcd.errors import InputError
from wrcd.tools.said import Said
from wrcd.tools.story.records import Truth
from wrcd.tools.story.scan import Scan, right_crc

NAME = re.compile(r"SimTruth_A(\d+)")
SIGNALS = {"MuAvailable", "MuUsed"}


def load(files: Sequence[Path]) -> list[Database]:
    """Further DBCs. Raises InputError for one that cannot be read."""
    return [load_dbc(file) for file in files]


def truths(databases: Sequence[Database]) -> dict[int, Message]:
    """The messages that carry the truth, by axle; of several DBCs the last wins."""
    out: dict[int, Message] = {}
    for database in databases:
        for m in database.messages:
            found = NAME.fullmatch(m.name)
            if found and {s.name for s in m.signals} >= SIGNALS and m.name not in database.unsound:
                out[int(found[1])] = m
    return out


def truth(scan: Scan, message: Message | None) -> Truth | None:
    """The truth of an axle, None if the log has none. Raises InputError for a message that is protected in another way
    than ours."""
    if message is None:
        return None
    said, frames = Said(message), scan.of(message_key(message))
    try:
        identity = data_id(message)
    except ValueError as e:
        raise InputError(str(e), key="--dbc") from None
    good = frames.lengths == said.length if identity is None else right_crc(frames, identity, said.length)
    frames = frames.only(good)
    if not len(frames):
        return None
    values = said.read(frames.data)
    return Truth(frames.time_us, values["MuAvailable"].astype(np.float32), values["MuUsed"].astype(np.float32))
