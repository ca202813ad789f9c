"""A process as consumer: its lines, its end, and what it prints beside."""

import sys
from collections.abc import Callable

import pytest

from tests.support.processes import wait_for
from wrcd.contract import BusSettings, ConsumerError, ProcessConsumer, Use

SAY = "import sys, time\nprint(sys.argv[1], flush=True)\ntime.sleep(60)"
BUS = BusSettings("virtual", "here", None, (1, 2))


def process(code: str, *words: str) -> ProcessConsumer:
    return ProcessConsumer([sys.executable, "-S", "-c", code, *words])


Started = Callable[[ProcessConsumer], ProcessConsumer]


@pytest.fixture
def started(request: pytest.FixtureRequest) -> Started:
    def start(consumer: ProcessConsumer) -> ProcessConsumer:
        consumer.start(BUS)
        request.addfinalizer(consumer.stop)
        return consumer

    return start


def fails(consumer: ProcessConsumer) -> bool:
    try:
        consumer.use(1)
    except ConsumerError:
        return True
    return False


def test_newest_line_of_an_axle_is_its_decision_and_null_falls_back(started: Started) -> None:
    decisions = ((1, "9.5"), (2, "4"), (1, "17"), (4, "9"), (4, "null"), (2, "3"))
    consumer = started(process(SAY, "\n".join(f'{{"axle": {axle}, "limit": {limit}}}' for axle, limit in decisions)))
    wait_for("the last line", 10, lambda: consumer.use(2) == Use(3.0, 2))
    assert [consumer.use(axle).limit_pct for axle in (1, 3, 4)] == [17.0, None, None]


def test_names_of_the_bus_are_filled_in(started: Started) -> None:
    code = 'import sys, time\nprint(\'{"axle": 1, "limit": %d}\' % len(sys.argv[1]), flush=True)\ntime.sleep(60)'
    consumer = started(process(code, "{interface}:{channel}:{config}"))
    wait_for("the line", 10, lambda: consumer.use(1).limit_pct == len("virtual:here:"))


def test_process_that_ends_is_told_with_what_it_said(started: Started) -> None:
    consumer = started(process("import sys\nsys.exit('no such bus')"))
    wait_for("its end", 10, lambda: fails(consumer))
    with pytest.raises(ConsumerError, match="ended with status 1: no such bus"):
        consumer.use(1)


NO_NUMBERS = [f'{{"axle": 1, "limit": {number}}}' for number in ("NaN", "Infinity", "-1e999", "1" + 400 * "0")]


@pytest.mark.parametrize("line", ["hello", '{"axle": 1}', '{"axle": 1, "limit": "much"}', "17", "[1, 2]", *NO_NUMBERS])
def test_line_that_is_no_decision_is_told(started: Started, line: str) -> None:
    consumer = started(process(SAY, line))
    wait_for("the line", 10, lambda: fails(consumer))
    with pytest.raises(ConsumerError, match="line"):
        consumer.use(1)


def test_command_that_is_not_there_is_told() -> None:
    with pytest.raises(ConsumerError, match="/no/such/program"):
        ProcessConsumer("/no/such/program -i {interface}").start(BUS)


def test_process_that_ignores_sigterm_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wrcd.contract.consumers.STOP_S", 0.2)
    code = 'import signal, time\nsignal.signal(15, signal.SIG_IGN)\nprint(\'{"axle": 1, "limit": 1}\', flush=True)'
    consumer = process(f"{code}\ntime.sleep(60)")
    consumer.start(BUS)
    wait_for("the line", 10, lambda: consumer.use(1) == Use(1.0, 1))
    child = consumer._process
    assert child is not None
    consumer.stop()
    assert child.returncode == -9
