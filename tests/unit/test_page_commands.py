"""The runner of the pages' commands notices what goes wrong, and stops what it has started."""

import contextlib
from pathlib import Path

import pytest

from tests.support import page_commands
from tests.support.page_commands import run_by, run_page, steps, to_run

HERE: frozenset[str] = frozenset()


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which `of` writes a page; what runs there sees nothing of the repository."""
    monkeypatch.setattr(page_commands, "ROOT", tmp_path)
    monkeypatch.setattr(page_commands, "KEPT", ())
    return tmp_path


def of(folder: Path, *blocks: str) -> tuple[Path, Path]:
    """A page of fences with what stands above them, and a folder to run it in."""
    page, work = folder / "page.md", folder / "work"
    page.write_text("# Page\n\n" + "\n\n".join(f"{b}\n```" for b in blocks) + "\n", encoding="utf-8")
    work.mkdir()
    return page, work


def test_blocks_run_in_order_in_one_folder_with_the_files_of_the_page(run: Path) -> None:
    page, work = of(
        run,
        "<!-- file: a.toml -->\n```toml\nx = 1",
        "<!-- given: echo 2 >given -->\n```sh\ncat a.toml given >both",
        "```sh\ngrep -q 2 both\ncp both \\\n    again",
    )
    run_page(page, work, HERE)
    assert (work / "again").read_text() == "x = 1\n2\n"


@pytest.mark.parametrize("body", ["false\ntrue", "true\nfalse", "false | true", "echo $UNSET"])
def test_failing_command_fails_the_page(run: Path, body: str) -> None:
    page, work = of(run, f"```sh\n{body}")
    with pytest.raises(AssertionError, match=r"page\.md:3:"):
        run_page(page, work, HERE)


def test_failing_given_fails_the_page(run: Path) -> None:
    page, work = of(run, "<!-- given: false -->\n<!-- run: exit 1 -->\n```sh\nfalse")
    with pytest.raises(AssertionError):
        run_page(page, work, HERE)


def test_command_that_fails_in_the_background_fails_the_page(run: Path) -> None:
    page, work = of(run, "```sh\nfalse &\nsleep 0.5")
    with pytest.raises(AssertionError, match="in the background failed"):
        run_page(page, work, HERE)


def test_stated_status_is_demanded(run: Path) -> None:
    page, work = of(run, "<!-- run: exit 1 -->\n```sh\nfalse", "<!-- run: exit 0 or 1 -->\n```sh\nfalse")
    run_page(page, work, HERE)
    page.write_text("<!-- run: exit 1 -->\n```sh\ntrue\n```\n")
    (work / ".venv").unlink()
    with pytest.raises(AssertionError, match="ended with 0, not with 1"):
        run_page(page, work, HERE)


@pytest.mark.parametrize("when", ["stop after 1 s", "stop 1 s after its first line"])
def test_endless_command_gets_ctrl_c(run: Path, when: str) -> None:
    endless = (
        "import time\ntry:\n    print(1, flush=True)\n    time.sleep(99)\nfinally:\n    open('ended', 'w').close()\n"
    )
    page, work = of(run, f"<!-- run: {when} -->\n```sh\npython forever.py | cat")
    (work / "forever.py").write_text(endless)
    run_page(page, work, HERE)
    assert (work / "ended").exists()


def test_command_that_fails_before_it_is_stopped_fails_the_page(run: Path) -> None:
    page, work = of(run, "<!-- run: stop 1 s after its first line -->\n```sh\nsh -c 'echo 1; exit 3'")
    with pytest.raises(AssertionError, match="ended with 3"):
        run_page(page, work, HERE)


def test_what_goes_to_the_background_ends_with_the_page(run: Path) -> None:
    page, work = of(run, "```sh\nsleep 99 &\necho $! >pid", "```sh\nkill -0 $(cat pid)")
    run_page(page, work, HERE)
    with contextlib.suppress(FileNotFoundError):  # a zombie may be left: its parent is gone
        state = Path("/proc", (work / "pid").read_text().strip(), "stat").read_text().rpartition(")")[2].split()[0]
        assert state == "Z"


KEYS = "stty raw; echo press q to quit; [ $(head -c 1) = q ] && stty size >size"


def test_screen_gets_its_key_at_a_terminal(run: Path) -> None:
    page, work = of(run, f'<!-- run: q at "q to quit" -->\n```sh\n{KEYS}')
    run_page(page, work, HERE)
    assert (work / "size").read_text() == "34 110\n"


@pytest.mark.parametrize(("body", "status"), [("echo something else", 124), (f"{KEYS}; exit 3", 3)])
def test_screen_that_does_not_come_or_ends_badly_fails_the_page(run: Path, body: str, status: int) -> None:
    page, work = of(run, f'<!-- run: q at "q to quit" -->\n```sh\n{body}')
    with pytest.raises(AssertionError, match=f"ended with {status}"):
        run_page(page, work, HERE)


def test_block_that_another_test_runs_is_left_to_it(run: Path) -> None:
    page, _ = of(run, "<!-- run by: tests/x.py -->\n```sh\na  # why\nb \\\n    c", "```sh\nd")
    assert [s.body for s in to_run(page, HERE)] == ["d\n"]
    assert [s.commands for s in run_by("tests/x.py", "page.md")] == [["a", "b      c"]]


def test_block_for_a_bus_is_left_to_the_guest(run: Path) -> None:
    page, _ = of(run, "<!-- run: vcan -->\n```sh\na", "```sh\nb", "<!-- not run: hours -->\n```sh\nc")
    assert [s.body for s in to_run(page, HERE)] == ["b\n"]
    assert [s.body for s in to_run(page, frozenset({"vcan"}))] == ["a\n"]


def test_mark_that_means_nothing_is_refused(run: Path) -> None:
    page, _ = of(run, "<!-- run: sometimes -->\n```sh\na")
    with pytest.raises(ValueError, match="sometimes"):
        steps(page)
