"""The screen as text: what is where, at any size, without colour."""

import re

import pytest

from tests.support.daemon_frames import DEGRADED, GOOD, NOTHING, START_US, DaemonFrames
from tests.support.snapshots import assert_kept
from wrcd.bus.dbc import find_message
from wrcd.core.configuration import Config
from wrcd.logs.why import explain
from wrcd.monitor.board import Board, ScreenView, layout
from wrcd.monitor.buffers import Batch
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.canvas import STYLES
from wrcd.monitor.history import Happening
from wrcd.monitor.panels import SourceState, why

LIVE = SourceState("socketcan:can0", "live")
S = 1_000_000
BEGIN, NOW, WIDTH = 1000 * S, 1100 * S, 60
FOUND = [Happening(1010 * S, "one", True), Happening(1050 * S, "two", False), Happening(1090 * S, "three", True)]


@pytest.fixture(scope="module")
def model(config: Config) -> BusModel:
    """30 % for nine seconds, two tenths Degraded, 5 % for six, then silence for 3.2 s."""
    made = DaemonFrames(config)
    low = {**GOOD, "MuAvailable": 5.0, "MuUsed": 4.0, "Surface": "Low", "ContactState": "Saturated"}
    every = range(len(config.axles))
    frames = [
        *made.stretch(0, 1_000_000, NOTHING, "WarmingUp", every),
        *made.stretch(1_000_000, 9_000_000, GOOD, axles=every),
        *made.stretch(9_000_000, 9_200_000, {**DEGRADED, "MuAvailable": 15.0}, "TooLittleData", every),
        *made.stretch(9_200_000, 15_200_000, low, axles=every),
    ]
    out = BusModel(config)
    out.take(Batch.of_frames(frames), START_US + 18_380_000)
    out.update()
    return out


def shown(model: BusModel, width: int, height: int, view: ScreenView | None = None, source: SourceState = LIVE) -> str:
    return Board(model, view or ScreenView()).draw(width, height, source).text()


def at(model: BusModel, seconds: float) -> ScreenView:
    view = ScreenView()
    view.go(START_US + round(seconds * 1e6), model.now_us, START_US, 55)
    return view


DOWN = SourceState("socketcan:can0", "live", "Down", 17)


@pytest.mark.parametrize(
    ("size", "seconds", "source"),
    [
        ((80, 24), None, LIVE), ((80, 24), 8.0, LIVE), ((60, 19), 9.1, LIVE), ((160, 50), 9.1, LIVE),
        ((80, 24), 0.5, DOWN), ((80, 24), 14.0, LIVE), ((80, 24), 18.0, LIVE), ((59, 19), 8.0, LIVE),
    ],
)  # fmt: skip
def test_screen_is_as_it_was(
    model: BusModel, size: tuple[int, int], seconds: float | None, source: SourceState
) -> None:
    """Of now, where the daemon is silent; Valid; Degraded, whose cause has room or not; the link down, frames lost."""
    text = shown(model, *size, None if seconds is None else at(model, seconds), source)
    text = re.sub(r"\b\d\d:\d\d:\d\d\b", "HH:MM:SS", text)  # of the computer's time zone
    title = f"{size[0]} by {size[1]}, {'now' if seconds is None else f'{seconds:g} s'}"
    assert_kept("screens", title, (line.rstrip() for line in text.split("\n")))


@pytest.mark.parametrize("size", [(60, 19), (80, 24), (100, 30), (132, 43), (200, 60), (400, 120)])
def test_every_line_fits_the_screen(model: BusModel, size: tuple[int, int]) -> None:
    for view in (ScreenView(), at(model, 9.1), ScreenView(axle=3)):
        canvas = Board(model, view).draw(*size, LIVE)
        assert canvas.characters.shape == (size[1], size[0])
        assert canvas.styles.max() < len(STYLES)


@pytest.mark.parametrize("axles", range(1, 9))
@pytest.mark.parametrize("size", [(60, 19), (80, 24), (200, 60)])
def test_parts_of_a_layout_do_not_overlap(axles: int, size: tuple[int, int]) -> None:
    places = layout(*size, axles, 4)
    assert places is not None
    taken: set[tuple[int, int]] = set()
    for rect in (places.status, places.axles, places.plot, places.legend, places.events, places.residuals,
                 places.inputs, places.keys):  # fmt: skip
        cells = {(x, y) for x in range(rect.x, rect.x + rect.width) for y in range(rect.y, rect.y + rect.height)}
        assert not cells & taken
        assert all(x < size[0] and y < size[1] for x, y in cells)
        taken |= cells
    assert not {(x, y) for x in range(size[0]) for y in (places.scale.y, places.strip.y)} & taken


def test_fall_is_found_and_explained_as_by_wrcd_why(model: BusModel) -> None:
    board = Board(model, ScreenView())
    fell = [h for h in board.happenings() if h.is_fall]
    assert len(fell) == 1
    assert fell[0].text.startswith("available fell from 30.0 to 5.0 %; Degraded for 0.2 s, TooLittleData")
    text = "\n".join(line for line, _ in why(model, board.axle, fell[0].time_us, 100))
    for part in ("Axle 1 at 9.", "available adhesion fell from 30 to 5.0 %", "rule 7: If residual 1",
                 "a second before", "30.0 %", "-24.0 wins"):  # fmt: skip
        assert part in text, part


def test_explanation_has_the_torque_of_the_newest_frame(config: Config) -> None:
    """Not of one up to a tenth of a second before it."""
    made = DaemonFrames(config)
    frames = made.stretch(0, 12_000_000, GOOD)
    frames += [made.sensor("Torque_A1", t, Status=0, Torque=t // 5000) for t in range(0, 12_000_000, 5_000)]
    model = BusModel(config)
    model.take(Batch.of_frames(sorted(frames, key=lambda f: f.stamp_us)), 0)
    model.update()
    text = "\n".join(line for line, _ in why(model, model.axles[0], START_US + 9_055_000, 200))
    signal = find_message(config.database, "Torque_A1").get_signal_by_name("Torque")
    before, after = (float(signal.scale) * raw + float(signal.offset) for raw in (8_055 // 5, 10_055 // 5))
    story = model.story(model.axles[0], START_US + 9_055_000)
    now = explain(story, 1, START_US + 9_055_000)
    assert now.torque_Nm == pytest.approx(float(signal.scale) * (9_055 // 5) + float(signal.offset))
    assert f"torque {before / 1000:.1f} kN\u00a0m" in text
    assert f"torque {after / 1000:.1f} kN\u00a0m" in text


def test_explanation_of_an_axle_without_frames_says_so(config: Config) -> None:
    assert why(model := BusModel(config), model.axles[0], 0, 80)[0][0] == "no Adhesion frame has come of it"


def test_only_changed_cells_are_told(model: BusModel) -> None:
    before = Board(model, at(model, 8.0)).draw(80, 24, LIVE)
    after = Board(model, at(model, 8.0)).draw(80, 24, SourceState("socketcan:can0", "live", "Up", 3))
    assert before.changes(before) == []
    changed = after.changes(before)
    assert 1 <= sum(rect.width for rect in changed) <= 8


def test_axles_of_which_nothing_came_are_hidden_and_counted(config: Config) -> None:
    made, every = DaemonFrames(config), range(len(config.axles))
    out = BusModel(config)
    out.take(Batch.of_frames(made.stretch(0, 1_000_000, NOTHING, "InputSilent", every)), START_US + 1_000_000)
    out.update()
    assert shown(out, 80, 24).count("NotAvailable") >= len(every)  # nothing came of any
    assert "hidden" not in shown(out, 80, 24)
    third = [
        *made.stretch(1_000_000, 2_000_000, NOTHING, "InputSilent", [0, 1, 3]),
        *made.stretch(1_000_000, 2_000_000, GOOD, axles=[2]),
    ]
    out.take(Batch.of_frames(sorted(third, key=lambda f: f.stamp_us)), START_US + 2_000_000)
    out.update()
    text = shown(out, 80, 24)
    assert "3 more are configured, of which nothing came: hidden" in text
    assert "NotAvailable" not in text
    assert "▶3" in text
    out.take(Batch.of_frames([made.sensor("YawRate_A2", 2_000_000, YawRate=1.0)]), START_US + 2_010_000)
    out.update()
    text = shown(out, 80, 24)
    assert "2 more are configured" in text
    assert "NotAvailable" in text


def test_view_moves_on_with_time_and_paused_stands_still() -> None:
    view, later = ScreenView(), NOW + 30 * S
    assert view.is_live
    assert view.at_us(later) == later
    assert view.window(later, WIDTH).end_us >= later
    view.pause(NOW)
    assert (view.at_us(later), view.window(later, WIDTH)) == (NOW, view.window(NOW, WIDTH))
    view.resume()
    assert view.at_us(later) == later


def test_cursor_left_of_the_plot_takes_it_along() -> None:
    view = ScreenView()
    for _ in range(100):
        view.move(-10, NOW, BEGIN, WIDTH)
        w = view.window(NOW, WIDTH)
        assert view.cursor_us is not None
        assert w.begin_us <= view.cursor_us < w.end_us
    assert view.cursor_us == BEGIN
    assert not view.is_live
    view.move(1_000_000, NOW, BEGIN, WIDTH)
    assert view.cursor_us == NOW


@pytest.mark.parametrize("closer", [True, False])
def test_zoom_keeps_the_cursor_in_the_plot(closer: bool) -> None:
    view = ScreenView()
    view.go(1040 * S, NOW, BEGIN, WIDTH)
    for _ in range(30):
        view.zoom(closer, NOW, WIDTH)
        w = view.window(NOW, WIDTH)
        assert w.begin_us <= 1040 * S < w.end_us
    assert view.span_s == (2 if closer else 86400)


def test_jumps_go_through_all_happenings_and_stop_at_the_ends() -> None:
    view = ScreenView()
    back = [view.jump(FOUND, False, NOW, BEGIN, WIDTH) for _ in range(4)]
    assert back == [*reversed(FOUND), None]
    assert view.cursor_us == FOUND[0].time_us
    forward = [view.jump(FOUND, True, NOW, BEGIN, WIDTH) for _ in range(3)]
    assert forward == [FOUND[1], FOUND[2], None]


def test_happening_after_the_pause_is_not_jumped_to() -> None:
    view = ScreenView()
    view.pause(1060 * S)
    assert view.jump(FOUND, True, NOW, BEGIN, WIDTH) == FOUND[1]
    assert view.jump(FOUND, True, NOW, BEGIN, WIDTH) is None
