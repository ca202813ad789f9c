"""Keys and sizes of the real screen, turned by hand: no clock decides what is seen."""

import asyncio
import html
import re
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from textual.binding import Binding
from textual.pilot import Pilot

from tests.support.daemon_frames import GOOD, START_US, DaemonFrames
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.monitor.buffers import Batch
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.panels import SourceState
from wrcd.monitor.screen import KEYS, Monitor
from wrcd.monitor.sources import NoMore
from wrcd.monitor.widgets import CanvasWidget, TextPage

Steps = Callable[[Pilot[Any]], Awaitable[None]]


class Fed:
    """A live source that gives what a test puts in."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Batch, int]] = []
        self.closed = False

    def put(self, frames: list[Frame], until_us: int) -> None:
        self.waiting.append((Batch.of_frames(frames), START_US + until_us))

    def take(self) -> Iterator[tuple[Batch, int]]:
        out, self.waiting = self.waiting, []
        return iter(out)

    def state(self) -> SourceState:
        return SourceState("socketcan:can0", "live")

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def made(config: Config) -> DaemonFrames:
    return DaemonFrames(config)


@pytest.fixture
def fed(made: DaemonFrames) -> Fed:
    """A dry rail for nine seconds, then leaves for six."""
    out = Fed()
    low = {**GOOD, "MuAvailable": 5.0, "MuUsed": 4.0}
    out.put([*made.stretch(0, 9_000_000, GOOD), *made.stretch(9_000_000, 15_000_000, low)], 14_990_000)
    return out


def turned(app: Monitor, steps: Steps, size: tuple[int, int] = (80, 24)) -> None:
    """Run the steps on the screen."""

    async def run() -> None:
        async with app.run_test(size=size) as pilot:
            await pilot.pause()
            await steps(pilot)

    asyncio.run(run())


class Preempted:
    """The clock of Textual's timers on a computer that is busy whenever they look."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def get_time(self) -> float:
        self.now_s += 0.02
        return self.now_s


def live(config: Config, source: Fed, folder: Path | None = None) -> Monitor:
    return Monitor(BusModel(config), source, ticking=False, folder=folder)


def of_log(config: Config, source: Fed, folder: Path | None = None) -> Monitor:
    model = BusModel(config)
    for batch, until_us in source.take():
        model.take(batch, until_us)
    model.update()
    return Monitor(model, NoMore("ride.log"), ticking=False, folder=folder)


def seen(app: Monitor) -> str:
    canvas = app._widget.canvas
    assert canvas is not None
    return canvas.text()


def test_pause_holds_the_screen_and_loses_nothing(config: Config, fed: Fed, made: DaemonFrames) -> None:
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        assert " LIVE " in seen(app)
        await pilot.press("space")
        held = seen(app)
        assert "PAUSED" in held
        fed.put(made.stretch(15_000_000, 20_000_000, GOOD), 20_000_000)
        app.tick()
        # the mode's line tells how far behind; all else stands still
        assert seen(app).split("\n")[2:] == held.split("\n")[2:]
        assert len(app.model.axles[0].held.adhesion.time_us) == 1000
        await pilot.press("space")
        assert "30.0 %" in seen(app).split("\n")[3]
        assert "LIVE" in seen(app)

    turned(app, steps)
    assert fed.closed


def test_two_keys_answer_why_it_fell(config: Config, fed: Fed) -> None:
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        await pilot.press("n", "w")
        assert isinstance(app.screen, TextPage)
        text = "\n".join(line for line, _ in app.screen._lines)
        assert "available adhesion fell from 30 to 5.0 % between 8.9" in text
        assert "rule 7: If residual 1" in text
        await pilot.press("escape")
        assert not isinstance(app.screen, TextPage)

    turned(app, steps)


@pytest.mark.parametrize(("key", "said"), [("w", "Axle 1 at"), ("e", "available fell"), ("question_mark", "pause")])
def test_page_opens_and_the_same_key_closes_it(config: Config, fed: Fed, key: str, said: str) -> None:
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        await pilot.press(key)
        assert isinstance(app.screen, TextPage)
        assert any(said in line for line, _ in app.screen._lines)
        await pilot.press(key)
        assert not isinstance(app.screen, TextPage)

    turned(app, steps)


def test_cursor_zoom_and_ends_move_through_time(config: Config, fed: Fed) -> None:
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        await pilot.press("left")
        near = app.view.cursor_us
        await pilot.press("pageup")
        far = app.view.cursor_us
        assert near is not None
        assert far is not None
        assert START_US < far < near < START_US + 15_000_000
        await pilot.press("plus")
        assert app.view.span_s == 20
        await pilot.press("minus", "minus")
        assert app.view.span_s == 60
        await pilot.press("home")
        assert app.view.cursor_us == START_US
        await pilot.press("end")
        assert app.view.is_live

    turned(app, steps)


def test_new_size_is_taken_by_a_busy_computer(config: Config, fed: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("textual.timer._time", Preempted())
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        for size in ((100, 30), (60, 19), (80, 24)):
            await pilot.resize_terminal(*size)
            await pilot.pause()
            assert app.query_one(CanvasWidget).size == size

    turned(app, steps)


def test_axles_that_came_are_chosen_by_number_and_arrow(config: Config, fed: Fed, made: DaemonFrames) -> None:
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        await pilot.press("3")
        assert "nothing came of axle 3" in seen(app)
        await pilot.press("down")
        assert app.board.axle.number == 1
        fed.put(made.stretch(15_000_000, 15_100_000, GOOD, axles=range(len(config.axles))), 15_100_000)
        app.tick()
        await pilot.press("3")
        assert app.board.axle.number == 3
        await pilot.press("down", "down")
        assert app.board.axle.number == 1
        await pilot.press("8")
        assert "there is no axle 8" in seen(app)

    turned(app, steps)


def test_save_writes_a_log_and_a_picture_and_never_over_another(config: Config, fed: Fed, tmp_path: Path) -> None:
    app = live(config, fed, tmp_path)

    async def steps(pilot: Pilot[Any]) -> None:
        for _ in range(2):
            await pilot.press("s")
            await app.workers.wait_for_complete()

    turned(app, steps)
    logs, pictures = sorted(tmp_path.glob("*.log")), sorted(tmp_path.glob("*.svg"))
    assert [f.stem for f in logs] == [f.stem for f in pictures]
    assert len(logs) == 2
    assert re.fullmatch(r"wrcd-monitor-can0-\d{8}-\d{6}(-2)?", logs[0].stem)
    held = [f for f, _ in read_log(logs[0], Damage())]
    assert len(held) == app.model.load.frames
    assert held == [f for batch in app.model.held for f in batch.frames()]
    picture = pictures[0].read_text()
    assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", picture)
    assert "available" in picture


def test_picture_has_the_count_of_lost_frames_of_now(
    config: Config, fed: Fed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    app = live(config, fed, tmp_path)

    async def steps(pilot: Pilot[Any]) -> None:
        assert "lost 0" in seen(app)
        monkeypatch.setattr(fed, "state", lambda: SourceState("socketcan:can0", "live", lost=17))
        app.tick()
        await pilot.pause()
        await pilot.press("s")
        await app.workers.wait_for_complete()

    turned(app, steps)
    (picture,) = tmp_path.glob("*.svg")
    drawn = html.unescape(picture.read_text()).replace("\xa0", " ")
    assert re.findall(r"lost +\d+", drawn) == ["lost 17"]


def test_save_of_a_log_is_the_part_that_is_seen(config: Config, fed: Fed, tmp_path: Path) -> None:
    app = of_log(config, fed, tmp_path)

    async def steps(pilot: Pilot[Any]) -> None:
        await pilot.press("plus", "plus", "s")
        await app.workers.wait_for_complete()

    turned(app, steps)
    (log,) = tmp_path.glob("wrcd-monitor-ride-*.log")
    held = [f.stamp_us for f, _ in read_log(log, Damage())]
    model = app.model
    w = app.view.window(model.now_us, app.board.plot_width)
    assert START_US < w.begin_us <= min(held)
    assert max(held) < w.end_us < START_US + 15_000_000
    assert len(held) == sum(w.begin_us <= f.stamp_us < w.end_us for b in model.held for f in b.frames())


def test_folder_that_takes_no_file_is_told(config: Config, fed: Fed, tmp_path: Path) -> None:
    app = live(config, fed, tmp_path / "gone")

    async def steps(pilot: Pilot[Any]) -> None:
        await pilot.press("s")
        app.redraw()
        assert "not saved: No such file or directory" in seen(app)

    turned(app, steps)


def test_log_begins_at_its_first_fall(config: Config, fed: Fed) -> None:
    app = of_log(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        assert app.view.cursor_us == pytest.approx(START_US + 9_000_000, abs=20_000)
        assert " LOG " in seen(app)
        assert app.view.span_s == 15
        await pilot.press("space")
        assert "a log stands still" in seen(app)

    turned(app, steps)


@pytest.mark.parametrize("size", [(60, 19), (80, 24), (200, 60), (30, 5)])
def test_any_size_is_drawn(config: Config, fed: Fed, size: tuple[int, int]) -> None:
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        canvas = app._widget.canvas
        assert canvas is not None
        assert (canvas.width, canvas.height) == size
        await pilot.resize_terminal(100, 30)
        await pilot.pause()
        assert app._widget.canvas is not None
        assert app._widget.canvas.width == 100

    turned(app, steps, size)


def test_colours_go_through_terminal_dark_and_light(config: Config, fed: Fed) -> None:
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        found = []
        for _ in range(4):
            found.append(app.colours)
            await pilot.press("t")
        assert found == ["terminal", "dark", "light", "terminal"]

    turned(app, steps)


def test_no_color_gives_a_screen_without_colour(config: Config, fed: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        assert app.colours == "none"
        for y in range(24):
            for segment in app._widget.render_line(y):
                assert segment.style is None or (segment.style.color is None and segment.style.bgcolor is None)
        await pilot.press("t")
        assert "NO_COLOR is set" in seen(app)

    turned(app, steps)


def test_nothing_new_repaints_nothing(config: Config, fed: Fed) -> None:
    app = live(config, fed)

    async def steps(pilot: Pilot[Any]) -> None:
        app.tick()
        before = app.updates
        app.tick()
        assert app.updates == before

    turned(app, steps)


NAMES = {
    "left": "←", "right": "→", "up": "↑", "down": "↓", "plus": "+", "minus": "-", "question_mark": "?", "home": "Home",
    "end": "End", "enter": "Enter", "escape": "Esc", "pageup": "PgUp", "pagedown": "PgDn", "shift+left": "Shift",
    "shift+right": "Shift",
}  # fmt: skip
UNTOLD = {"equals_sign", "z", "Z", "underscore", "N", "tab", "h", "ctrl+c"}  # second keys of what is told


def test_keys_that_help_tells_are_those_that_are_bound() -> None:
    bound = {key for b in Monitor.BINDINGS if isinstance(b, Binding) for key in b.key.split(",")} - UNTOLD
    told = {word.rstrip(",") for key, what, _ in KEYS for word in [*key.split(), *re.findall("Shift|PgUp|PgDn", what)]}
    assert told - {"…"} | {str(n) for n in range(1, 9)} == {NAMES.get(key, key) for key in bound}
