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


KEYS = "stty raw; echo press q to quit; [ $(head -c 1) = q ] && stty size >size"


@pytest.mark.parametrize(
    ("block", "reason"),
    [
        ("```sh\nfalse\ntrue", r"page\.md:3:"),
        ("```sh\ntrue\nfalse", r"page\.md:3:"),
        ("```sh\nfalse | true", r"page\.md:3:"),
        ("```sh\necho $UNSET", r"page\.md:3:"),
        ("<!-- given: false -->\n<!-- run: exit 1 -->\n```sh\nfalse", r"page\.md:"),
        ("```sh\nfalse &\nsleep 0.5", "in the background failed"),
        ("<!-- run: exit 1 -->\n```sh\ntrue", "ended with 0, not with 1"),
        ("<!-- run: stop 1 s after its first line -->\n```sh\nsh -c 'echo 1; exit 3'", "ended with 3"),
        ('<!-- run: q at "q to quit" -->\n```sh\necho something else', "ended with 124"),
        (f'<!-- run: q at "q to quit" -->\n```sh\n{KEYS}; exit 3', "ended with 3"),
    ],
)
def test_block_that_fails_fails_the_page(run: Path, block: str, reason: str) -> None:
    page, work = of(run, block)
    with pytest.raises(AssertionError, match=reason):
        run_page(page, work, HERE)


def test_stated_status_and_key_at_a_terminal_are_taken(run: Path) -> None:
    keys = f'<!-- run: q at "q to quit" -->\n```sh\n{KEYS}'
    page, work = of(run, "<!-- run: exit 1 -->\n```sh\nfalse", "<!-- run: exit 0 or 1 -->\n```sh\nfalse", keys)
    run_page(page, work, HERE)
    assert (work / "size").read_text() == "34 110\n"


@pytest.mark.parametrize("when", ["stop after 1 s", "stop 1 s after its first line"])
def test_endless_command_gets_ctrl_c(run: Path, when: str) -> None:
    endless = (
        "import time\ntry:\n    print(1, flush=True)\n    time.sleep(99)\nfinally:\n    open('ended', 'w').close()\n"
    )
    page, work = of(run, f"<!-- run: {when} -->\n```sh\npython forever.py | cat")
    (work / "forever.py").write_text(endless)
    run_page(page, work, HERE)
    assert (work / "ended").exists()


def test_what_goes_to_the_background_ends_with_the_page(run: Path) -> None:
    page, work = of(run, "```sh\nsleep 99 &\necho $! >pid", "```sh\nkill -0 $(cat pid)")
    run_page(page, work, HERE)
    with contextlib.suppress(FileNotFoundError):  # a zombie may be left: its parent is gone
        state = Path("/proc", (work / "pid").read_text().strip(), "stat").read_text().rpartition(")")[2].split()[0]
        assert state == "Z"


def test_block_is_left_to_another_test_to_the_guest_or_to_nobody(run: Path) -> None:
    others = "<!-- run by: tests/x.py -->\n```sh\na  # why\nb \\\n    c"
    page, _ = of(run, others, "```sh\nd", "<!-- run: vcan -->\n```sh\ne", "<!-- not run: hours -->\n```sh\nf")
    assert [s.body for s in to_run(page, HERE)] == ["d\n"]
    assert [s.body for s in to_run(page, frozenset({"vcan"}))] == ["e\n"]
    assert [s.commands for s in run_by("tests/x.py", "page.md")] == [["a", "b      c"]]


def test_mark_that_means_nothing_is_refused(run: Path) -> None:
    page, _ = of(run, "<!-- run: sometimes -->\n```sh\na")
    with pytest.raises(ValueError, match="sometimes"):
        steps(page)
