"""The plug-in as pytest finds it: options and fixtures. What it needs of wrcd is imported when a fixture is used."""

import importlib
import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from wrcd.contract.benches import Bench
    from wrcd.contract.consumers import Consumer, ObjectConsumer
    from wrcd.contract.contract_player import ContractPlayer
    from wrcd.contract.contract_rules import Check
    from wrcd.core.configuration import Config

MAX_AGE_MS = 60  # as the page proposes


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("wrcd_contract", "wrcd: contract of a consumer of Adhesion frames")
    group.addoption(
        "--wrcd-interface", metavar="NAME", default="socketcan", help="python-can's interface (%(default)s)"
    )
    group.addoption("--wrcd-channel", metavar="NAME", default="vcan0", help="its channel (%(default)s)")
    group.addoption("--wrcd-config", metavar="TOML", type=Path, help="the daemon's configuration: names, DBC, cycle")
    group.addoption("--wrcd-axle", metavar="N", type=int, help="axle to play (the configuration's first)")
    group.addoption(
        "--wrcd-sample-age",
        metavar="MS",
        type=int,
        default=MAX_AGE_MS,
        help="oldest measurement that it accepts, in ms (%(default)s)",
    )
    group.addoption("--wrcd-object", metavar="FILE:NAME", help="a Python class with hear(frame) and use(axle, now_us)")
    group.addoption(
        "--wrcd-process", metavar="COMMAND", help="a command; {interface}, {channel} and {config} stand for the bus"
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test that asks for wrcd_check is run for every rule."""
    if "wrcd_check" in metafunc.fixturenames:
        from wrcd.contract.contract_rules import CHECKS

        metafunc.parametrize("wrcd_check", CHECKS, ids=[c.name for c in CHECKS])


@pytest.fixture(scope="session")
def wrcd_consumer(request: pytest.FixtureRequest) -> "Consumer | ObjectConsumer":
    """The consumer under test: by --wrcd-object or --wrcd-process. Override it to hand over one of your own."""
    from wrcd.contract import ObjectConsumer, ProcessConsumer

    option = request.config.getoption
    command, named = option("--wrcd-process"), option("--wrcd-object")
    if bool(command) == bool(named):
        pytest.fail(
            "which consumer? Say --wrcd-object FILE:NAME or --wrcd-process COMMAND, or define a fixture wrcd_consumer "
            "with scope session",
            pytrace=False,
        )
    return ProcessConsumer(command) if command else ObjectConsumer(_named(named))


@pytest.fixture(scope="session")
def wrcd_config(request: pytest.FixtureRequest) -> "Config":
    """The configuration of --wrcd-config, or the default one."""
    from wrcd.config.config import load_config
    from wrcd.errors import InputError

    try:
        return load_config(request.config.getoption("--wrcd-config"))
    except InputError as e:
        pytest.fail(str(e), pytrace=False)


@pytest.fixture(scope="session")
def wrcd_bench(
    request: pytest.FixtureRequest, wrcd_consumer: "Consumer | ObjectConsumer", wrcd_config: "Config"
) -> "Iterator[Bench]":
    """Where it is tested: virtual time for an ObjectConsumer, else the bus, on which it is started once."""
    from wrcd.bus.dbc import find_message
    from wrcd.bus.positions import message_key
    from wrcd.contract.benches import BusBench, VirtualBench
    from wrcd.contract.consumers import BusSettings, ConsumerError, ObjectConsumer
    from wrcd.errors import InputError

    option = request.config.getoption
    axles = tuple(a.number for a in wrcd_config.axles)
    bus = BusSettings(option("--wrcd-interface"), option("--wrcd-channel"), option("--wrcd-config"), axles)
    bench: Bench
    try:
        if isinstance(wrcd_consumer, ObjectConsumer):
            bench = VirtualBench(wrcd_consumer)
        else:
            messages = [find_message(wrcd_config.database, a.adhesion.message) for a in wrcd_config.axles]
            bench = BusBench(wrcd_consumer, bus, tuple(map(message_key, messages)))
    except (InputError, ConsumerError) as e:
        pytest.fail(str(e), pytrace=False)
    yield bench
    bench.close()


@pytest.fixture
def wrcd_player(request: pytest.FixtureRequest, wrcd_bench: "Bench", wrcd_config: "Config") -> "ContractPlayer":
    """Plays frames of one axle to the consumer, for tests of one's own."""
    from wrcd.contract.contract_player import ContractPlayer
    from wrcd.contract.frames import FrameMaker

    number = request.config.getoption("--wrcd-axle")
    axles = list(wrcd_config.axles)
    axle = next((a for a in axles if number is None or a.number == number), None)
    if axle is None:
        pytest.fail(f"--wrcd-axle {number}: the configuration has {', '.join(str(a.number) for a in axles)}", False)
    other = next((FrameMaker(wrcd_config, a) for a in axles if a is not axle), None)
    wrcd_bench.start()
    return ContractPlayer(
        wrcd_bench, FrameMaker(wrcd_config, axle), request.config.getoption("--wrcd-sample-age"), other
    )


@pytest.fixture
def wrcd_judge(wrcd_player: "ContractPlayer") -> "Callable[[Check], None]":
    """Plays a rule: fails with one sentence where it is broken, skips what the messages cannot say."""
    from wrcd.contract.consumers import ConsumerError
    from wrcd.contract.contract_player import BrokenRule, CannotPlay
    from wrcd.errors import InputError

    def judge(check: "Check") -> None:
        broken = ""
        try:
            check.run(wrcd_player)
        except CannotPlay as e:
            pytest.skip(str(e))
        except BrokenRule as e:
            broken = f"{e}. {check.source}"
        except (ConsumerError, InputError) as e:
            broken = str(e)
        if broken:
            pytest.fail(broken, pytrace=False)

    return judge


def _named(text: str) -> "Callable[[], Any]":
    """What FILE:NAME or MODULE:NAME names."""
    place, _, name = text.rpartition(":")
    try:
        if place.endswith(".py"):
            spec = importlib.util.spec_from_file_location(Path(place).stem, place)
            assert spec is not None
            assert spec.loader is not None
            module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
        else:
            module = importlib.import_module(place)
        found: Callable[[], Any] = getattr(module, name)
    except (OSError, ImportError, AttributeError, ValueError) as e:
        pytest.fail(f"--wrcd-object {text}: {e}; it takes FILE.py:NAME or MODULE:NAME", pytrace=False)
    return found
