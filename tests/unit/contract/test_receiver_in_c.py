"""The receiver in C of `wrcd kit` keeps to the contract: judged by frames alone."""

import ctypes
import subprocess
from collections import deque
from pathlib import Path
from typing import Any

import pytest

from tests.support.contract import EXAMPLES, NAMES, on_virtual_time
from tests.support.kit.building import COMPILERS, HERE, WARNINGS, needs_compiler, written
from tests.support.kit.trains import odd_train
from tests.support.processes import ROOT
from wrcd.config.config import load_config
from wrcd.contract import Frame, Use

pytestmark = needs_compiler
THIRD = ROOT / "tests/data/dbc/third-party.toml"
RISE_US = 2_000_000
EXTENDED, FD, REMOTE, ERROR = 1, 2, 4, 8


class Receiver:
    """The receiver, and what it leaves to its controller: up over at least two seconds."""

    def __init__(self, library: Any, unprotected: bool) -> None:
        self._library, self._receiver = library, ctypes.c_void_p(library.made(int(unprotected)))
        self._lower: dict[int, deque[tuple[int, float]]] = {}

    def hear(self, frame: Frame) -> None:
        flags = EXTENDED * frame.extended | FD * frame.fd | REMOTE * frame.remote | ERROR * frame.error
        data = frame.data.ljust(8, b"\0")
        length = frame.extra if frame.remote else len(frame.data)
        self._library.fed(self._receiver, frame.can_id, flags, length, data, ctypes.c_uint64(frame.stamp_us))

    def use(self, axle: int, now_us: int) -> Use:
        lower = self._lower.setdefault(axle, deque())
        said = self._library.used(self._receiver, axle, ctypes.c_uint64(now_us))
        if said >= 0:
            lower.append((now_us, said / 100))
            while lower[0][0] < now_us - RISE_US:
                lower.popleft()
        return Use(min(v for _, v in lower) if lower and said != -1 else None, axle)

    def __del__(self) -> None:
        self._library.freed(self._receiver)


def library(folder: Path, config: Path | None) -> Any:
    written(folder, config)
    out = folder / "receiver.so"
    shared = ["-shared", "-fPIC", "-I", folder, "-o", out, HERE / "shared.c", folder / "adhesion.c"]
    subprocess.run([str(word) for word in (COMPILERS[0], *WARNINGS, *shared)], timeout=60, check=True)
    loaded = ctypes.CDLL(str(out))
    loaded.made.restype = ctypes.c_void_p
    return loaded


@pytest.mark.parametrize("train", [None, THIRD, EXAMPLES / "own-dbc" / "train.toml", "odd"])
def test_receiver_of_the_kit_keeps_to_every_rule(tmp_path: Path, train: Path | str | None) -> None:
    config = odd_train(tmp_path) if isinstance(train, str) else train
    loaded = library(tmp_path / "kit", config)
    broken, left = on_virtual_time(lambda: Receiver(loaded, config is not None), load_config(config))
    assert broken == {}
    assert bool(left) == (config is not None)
    assert len(NAMES) - len(left) >= (30 if train in (None, "odd") else 20)
