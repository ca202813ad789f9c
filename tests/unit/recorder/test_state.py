"""The state of a core: nobody forgets a part of it, and no file puts in what does not belong."""

import base64
import json
import random
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.recorded_train import RecordedTrain, exercise_all_state
from tests.support.scenarios import FOUR_AXLES, LogOf
from wrcd.checksum import checksum
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.errors import InputError
from wrcd.estimator.native_estimator import CompiledEstimator
from wrcd.estimator.paper.window import BLOCK_TICKS
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.recorder.resume import load
from wrcd.recorder.state import StateMismatch, capture, encode, restore, state_of

# what changes and nothing later hangs on: caches, results made anew
TRANSIENT = {
    "Bank": ("_fused", "_between"),
    "Core": ("explains", "_reports", "_slot_reports", "_tick", "_begin_us", "_end_us"),
    "Counts": ("rejected_by_message",),
    "Events": ("total", "_kept"),
    "Inputs": ("_shares_known", "_shares_ok"),
    "JumpCheck": ("jumped",),
    "LinkHealth": ("foreign_by_key",),
    "Writer": ("_start",),
}
PACKAGES = ("wrcd.estimator.", "wrcd.bus.", "wrcd.core.", "wrcd.recorder.")


def objects(root: Any) -> Iterator[tuple[str, Any]]:
    """Everything of our packages that a core is made of, by path. Frozen things count as values, the compiled
    estimator as the reference in its state."""
    seen: dict[int, Any] = {}  # kept alive: a reference is made for the walk, and what follows would take its ids

    def walk(path: str, value: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(value, CompiledEstimator):
            value = value.reference()
        if isinstance(value, dict):
            for key, v in value.items():
                yield from walk(f"{path}[{key}]", v)
        elif isinstance(value, (list, tuple, deque)):
            for i, v in enumerate(value):
                yield from walk(f"{path}[{i}]", v)
        elif ours(value) and id(value) not in seen:
            seen[id(value)] = value
            yield path, value
            for name in attributes(value):
                yield from walk(f"{path}.{name}", getattr(value, name))

    yield from walk("core", root)


def ours(value: Any) -> bool:
    params = getattr(type(value), "__dataclass_params__", None)
    frozen = params is not None and params.frozen
    return f"{type(value).__module__}.".startswith(PACKAGES) and not frozen and not isinstance(value, (str, int))


def attributes(thing: Any) -> list[str]:
    slots = (s for c in type(thing).__mro__ for s in getattr(c, "__slots__", ()))
    return sorted({*getattr(thing, "__dict__", ()), *slots})


def shown(value: Any) -> Any:
    """What tells a value from another: contents of plain things, identity of all others."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, dict):
        return sorted((str(k), shown(v)) for k, v in value.items())
    if isinstance(value, (list, tuple, deque)):
        return [shown(v) for v in value]
    if isinstance(value, str):
        return str(value)
    if value is None or isinstance(value, (bool, int, float, bytes)):
        return repr(value)
    return type(value).__name__ if ours(value) else id(value)


def snapshot(core: Core) -> dict[tuple[str, type, str], Any]:
    return {(path, type(o), name): shown(getattr(o, name)) for path, o in objects(core) for name in attributes(o)}


@pytest.mark.usefixtures("engine")
def test_every_changing_attribute_is_a_field_or_transient(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = RecordedTrain(config, tmp_path)
    before = snapshot(train.sim.core)
    changed: set[tuple[type, str]] = set()
    turn = train.recorder.turn

    def compare(now_us: int) -> None:
        turn(now_us)
        if train.sim.counter % 25 == 0 or train.sim.spike:
            now = snapshot(train.sim.core)
            changed.update((k[1], k[2]) for k, v in now.items() if before.get(k) != v)

    monkeypatch.setattr(train.recorder, "turn", compare)
    exercise_all_state(train)
    forgotten = [
        f"{c.__module__}.{c.__qualname__}.{name} changes: make it a field, or TRANSIENT if nothing hangs on it"
        for c, name in changed
        if name not in (*state_of(c).values(), *TRANSIENT.get(c.__name__, ()))
    ]
    assert sorted(forgotten) == []
    assert len(changed) > 40
    # what is named and never seen to change would mean that this test sees too little
    named = {(type(o), name) for _, o in objects(train.sim.core) for name in state_of(type(o)).values()}
    still = {f"{c.__name__}.{n}" for c, n in named - changed if not holds_objects(train.sim.core, c, n)}
    assert len(still) <= 0.15 * len(named), still


def holds_objects(core: Core, kind: type, name: str) -> bool:
    return any(
        any(p.startswith(f"{path}.{name}") for p, _ in objects(core)) for path, o in objects(core) if type(o) is kind
    )


@pytest.mark.usefixtures("engine")
def test_restored_core_equals_the_captured_one(config: Config, tmp_path: Path) -> None:
    train = RecordedTrain(config, tmp_path)
    exercise_all_state(train)
    core, again = train.sim.core, Core(config)
    restore(again, json.loads(json.dumps(encode(capture(core)), allow_nan=False)))
    passing = {(type(o), n) for _, o in objects(core) for n in TRANSIENT.get(type(o).__name__, ())}
    ours_now, theirs = snapshot(core), snapshot(again)
    differ = [
        f"{path}.{name}"
        for (path, kind, name), value in ours_now.items()
        if (kind, name) not in passing and value != theirs[path, kind, name]
    ]
    fixed = {f"{path}.{name}" for path, o in objects(core) for name in attributes(o) if not plain(getattr(o, name))}
    assert [d for d in differ if d not in fixed] == []


def plain(value: Any) -> bool:
    if isinstance(value, dict):
        return all(map(plain, value.values()))
    if isinstance(value, (list, tuple, deque)):
        return all(map(plain, value))
    return value is None or isinstance(value, (bool, int, float, str, bytes, np.ndarray)) or ours(value)


@pytest.mark.parametrize("ticks", range(1, BLOCK_TICKS))
def test_core_restored_within_a_block_sends_the_same_frames(log_of: LogOf, ticks: int) -> None:
    """After so many ticks of it."""
    config = load_config(None)
    frames = [f for f, _ in read_log(log_of(FOUR_AXLES), Damage())]
    core, at, tick_us = Core(config), 0, round(config.design.tick_s * 1e6)
    for moment in (0.2, 1.1, 2.7):  # the window not full yet, just full; every running mean settled
        while at < moment * 0.2 * len(frames) or (core.time_us or 0) // tick_us % BLOCK_TICKS != ticks:
            core.feed(frames[at])
            at += 1
        again = Core(config)
        restore(again, json.loads(json.dumps(encode(capture(core)), allow_nan=False)))
        rest = frames[at : at + 1500]
        sent = [[o.frame for f in rest for o in c.feed(f)] for c in (core, again)]
        at += len(rest)
        assert sent[0] == sent[1]
        assert len(sent[0]) > 50
        assert encode(capture(core)) == encode(capture(again))


@pytest.fixture(scope="module")
def dumped(config: Config, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dump to be damaged: its state file."""
    train = RecordedTrain(config, tmp_path_factory.mktemp("dumped"), seconds=1.0)
    train.run(1500)
    log = train.asked()
    return log.with_suffix(".state.json")


def signed(body: dict[str, Any]) -> bytes:
    return json.dumps({**body, "checksum": checksum(body)}).encode()


def test_state_of_another_design_dbc_or_configuration_is_rejected(dumped: Path, tmp_path: Path, config: Config) -> None:
    body = json.loads(dumped.read_bytes())
    path = tmp_path / "x.state.json"
    for key, says in (("design", "another design"), ("dbc", "another DBC")):
        path.write_bytes(signed({**body, key: "0" * 64}))
        with pytest.raises(InputError, match=says):
            load(path, Core(config))
    with pytest.raises(InputError, match="min_speed_m_s differ"):
        load(dumped, Core(replace(config, min_speed_m_s=5.0)))
    # where things lie, and what is odd there, is another matter
    load(dumped, Core(replace(config, channel="can7", file="elsewhere.toml", warnings=("elsewhere.toml:1: odd",))))


def test_replay_command_rejects_a_damaged_state(
    dumped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "x.log"
    log.write_bytes(dumped.with_name(dumped.name.replace(".state.json", ".log")).read_bytes())
    good = dumped.read_bytes()
    chance = random.Random(3)
    for _ in range(20):
        bad = bytearray(good)
        for _ in range(chance.choice((1, 1, 5, 100))):
            bad[chance.randrange(len(bad))] = chance.randrange(256)
        tmp_path.joinpath("x.state.json").write_bytes(bad[: chance.choice((len(bad), len(bad) // 2))])
        if bytes(bad) != good:
            assert main(["replay", str(log), "-o", str(tmp_path / "out.log")]) == 2
            assert "x.state.json: " in capsys.readouterr().err


def leaves(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield path
    if isinstance(node, dict):
        for key, v in node.items():
            yield from leaves(v, (*path, key))
    elif isinstance(node, list):
        for i, v in enumerate(node):
            yield from leaves(v, (*path, i))


HOSTILE: list[Any] = [
    None, True, 1 << 70, -5, 1e300, "x" * 500, [], {}, [[]] * 20_000, {"float": "1"}, {"hex": "zz"}, {"a": 1},
    {"dtype": "|O", "shape": [1], "base64": "AAAAAAAAAAA="},
    {"dtype": "<f8", "shape": [1 << 40], "base64": ""},
    {"dtype": "<f8", "shape": [-1], "base64": base64.b64encode(bytes(8)).decode()},
]  # fmt: skip


def test_hostile_state_with_a_good_checksum_is_rejected_or_fits(dumped: Path, tmp_path: Path, config: Config) -> None:
    """Whatever stands in a file: InputError, or a core whose arrays have their shapes and types."""
    body = json.loads(dumped.read_bytes())
    chance = random.Random(4)
    places = [p for p in leaves(body) if p and p[0] in ("core", "events", "lines", "configuration")]
    shapes = {p: getattr(v, "shape", None) for p, v in arrays(Core(config))}
    path = tmp_path / "x.state.json"
    refused = 0
    for place in chance.sample(places, 150):
        hostile = json.loads(json.dumps(body))
        node = hostile
        for key in place[:-1]:
            node = node[key]
        node[place[-1]] = chance.choice(HOSTILE)
        path.write_bytes(signed(hostile))
        core = Core(config)
        try:
            load(path, core)
        except InputError:
            refused += 1
        else:
            assert {p: v.shape for p, v in arrays(core)} == shapes
    assert refused > 100


def arrays(core: Core) -> Iterator[tuple[str, Any]]:
    for path, o in objects(core):
        for name in attributes(o):
            if isinstance(value := getattr(o, name), np.ndarray):
                yield f"{path}.{name}", value


def test_state_mismatch_names_the_attribute(config: Config) -> None:
    core = Core(config)
    node = encode(capture(core))
    node["estimator"]["bank"]["x"]["shape"] = [4, 5, 3]
    with pytest.raises(StateMismatch, match=r"core\.estimator\.bank\.x is not an array"):
        restore(core, node)
