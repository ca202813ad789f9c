"""The screen as text: what is where, at any size, without colour."""

import pytest

from tests.support.daemon_frames import DEGRADED, GOOD, NOTHING, START_US, DaemonFrames
from wrcd.bus.dbc import find_message
from wrcd.core.configuration import Config
from wrcd.tools.monitor.batch import Batch
from wrcd.tools.monitor.board import Board
from wrcd.tools.monitor.canvas import STYLES
from wrcd.tools.monitor.layout import layout
from wrcd.tools.monitor.model import Model
from wrcd.tools.monitor.panels import Link
from wrcd.tools.monitor.view import View
from wrcd.tools.monitor.why import story as story_of
from wrcd.tools.monitor.why import why
from wrcd.tools.story.explain import explain

LIVE = Link("socketcan:can0", "live")
FALL_S = 9.0


@pytest.fixture(scope="module")
def model(config: Config) -> Model:
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
    out = Model(config)
    out.take(Batch.of_frames(frames), START_US + 18_380_000)
    out.update()
    return out


def shown(model: Model, width: int, height: int, view: View | None = None, link: Link = LIVE) -> str:
    return Board(model, view or View()).draw(width, height, link).text()


def at(model: Model, seconds: float) -> View:
    view = View()
    view.go(START_US + round(seconds * 1e6), model.now_us, START_US, 55)
    return view


def test_silent_daemon_is_said_in_words(model: Model) -> None:
    text = shown(model, 80, 24)
    assert "no Adhesion frame for 3.2 s" in text
    assert text.count("Silent") >= 4


def test_small_screen_shows_every_part(model: Model) -> None:
    text = shown(model, 80, 24, at(model, 8.0))
    for part in ("30.0 %", "27.0…33.0", "10.0 %", "Adhering", "Dry", "Valid", "residuals, dB", "rule 7", "wins",
                 "yaw rate", "reach", "refused", "PAUSED 10.4 s ago", "load ", "lost 0", "8.0 s", "available",
                 "in use", "? help", "q quit"):  # fmt: skip
        assert part in text, part
    assert all(len(line) <= 80 for line in text.split("\n"))


def test_cursor_in_the_past_shows_what_was_said_then(model: Model) -> None:
    assert "NotAvailable" in shown(model, 80, 24, at(model, 0.5))
    assert "Degraded" in shown(model, 80, 24, at(model, 9.1))
    assert "5.0 %" in shown(model, 80, 24, at(model, 14.0))


def test_cause_is_told_in_words_where_there_is_room(model: Model) -> None:
    assert "TooLittl" in shown(model, 80, 24, at(model, 9.1))
    assert "too few measurements in the window" in shown(model, 160, 50, at(model, 9.1))


@pytest.mark.parametrize("size", [(60, 19), (80, 24), (100, 30), (132, 43), (200, 60), (400, 120)])
def test_every_line_fits_the_screen(model: Model, size: tuple[int, int]) -> None:
    for view in (View(), at(model, 9.1), View(axle=3)):
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
    assert not {(x, y) for x in range(size[0]) for y in (places.scale_y, places.strip_y)} & taken


def test_screen_that_is_too_small_says_so(model: Model) -> None:
    assert "needs 60 columns and 19 lines; this is 59 by 19" in shown(model, 59, 19)


def test_states_differ_without_colour(model: Model) -> None:
    """Each state has a sign and a word, each curve a shape."""
    signs = [shown(model, 80, 24, at(model, s)).split("\n")[3][3] for s in (0.5, 5.0, 9.1, 18.0)]
    assert signs == ["○", "●", "◐", "·"]


def test_lost_frames_and_a_link_that_is_down_are_shown(model: Model) -> None:
    text = shown(model, 80, 24, link=Link("socketcan:can0", "live", "Down", 17))
    assert "lost 17" in text
    assert "link Down" in text


def test_fall_is_found_and_explained_as_by_wrcd_why(model: Model) -> None:
    board = Board(model, View())
    fell = [h for h in board.happenings() if h.is_fall]
    assert len(fell) == 1
    assert fell[0].text.startswith("available fell from 30.0 to 5.0 %; Degraded for 0.2 s, TooLittleData")
    text = "\n".join(line for line, _ in why(board, fell[0].time_us, 100))
    for part in ("Axle 1 at 9.", "available adhesion fell from 30 to 5.0 %", "rule 7: If residual 1",
                 "a second before", "30.0 %", "-24.0 wins"):  # fmt: skip
        assert part in text, part


def test_explanation_has_the_torque_of_the_newest_frame(config: Config) -> None:
    """Not of one up to a tenth of a second before it."""
    made = DaemonFrames(config)
    frames = made.stretch(0, 12_000_000, GOOD)
    frames += [made.sensor("Torque_A1", t, Status=0, Torque=t // 5000) for t in range(0, 12_000_000, 5_000)]
    model = Model(config)
    model.take(Batch.of_frames(sorted(frames, key=lambda f: f.stamp_us)), 0)
    model.update()
    text = "\n".join(line for line, _ in why(Board(model, View()), START_US + 9_055_000, 200))
    signal = find_message(config.database, "Torque_A1").get_signal_by_name("Torque")
    before, after = (float(signal.scale) * raw + float(signal.offset) for raw in (8_055 // 5, 10_055 // 5))
    story = story_of(model, model.axles[0], (), START_US + 9_055_000)
    now = explain(story, 1, START_US + 9_055_000)
    assert now.torque_Nm == pytest.approx(float(signal.scale) * (9_055 // 5) + float(signal.offset))
    assert f"torque {before / 1000:.1f} kN\u00a0m" in text
    assert f"torque {after / 1000:.1f} kN\u00a0m" in text


def test_explanation_of_an_axle_without_frames_says_so(config: Config) -> None:
    assert why(Board(Model(config), View()), 0, 80)[0][0] == "no Adhesion frame has come of it"


def test_only_changed_cells_are_told(model: Model) -> None:
    before = Board(model, at(model, 8.0)).draw(80, 24, LIVE)
    after = Board(model, at(model, 8.0)).draw(80, 24, Link("socketcan:can0", "live", "Up", 3))
    assert before.changes(before.copy()) == []
    changed = after.changes(before)
    assert 1 <= sum(rect.width for rect in changed) <= 8


def test_axles_of_which_nothing_came_are_hidden_and_counted(config: Config) -> None:
    made, every = DaemonFrames(config), range(len(config.axles))
    out = Model(config)
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
