"""The receiver in C of a kit: it compiles without a warning, passes its own tests, and reads as we do."""

import re
import subprocess
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1
from tests.support.kit.building import COMPILERS, WARNINGS, build, make, needs_compiler, run, written
from tests.support.kit.reading import Reading, Verdict
from tests.support.kit.streams import counted, disturbed, lines
from tests.support.kit.trains import fd_message, odd_train, twin_train
from tests.support.pages import ROOT
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.core.configuration import Config
from wrcd.kit.c_tables import byte_list
from wrcd.kit.receiver import kit_message, messages
from wrcd.kit.vectors import turn, vectors
from wrcd.kit.write_kit import files_of
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

pytestmark = needs_compiler
TIMED_OUT = "5"  # of adhesion.h
VECTORS = ROOT / "tests/data/e2e_profile11_vectors.csv"
# as the DBC says
DEFAULT_US = dict.fromkeys(range(1, 5), 60_000)


@pytest.fixture(scope="module")
def default(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("default"))


def known_frames(said: str) -> int:
    found = re.search(r"(\d+) known frames, \d+ checks, 0 failed", said)
    assert found, said
    return int(found[1])


@pytest.mark.parametrize(
    ("train", "known"),
    [
        (None, 80),
        ("odd", 40),
        ("twin", 40),  # ids that differ in one bit or in their kind
        (ROOT / "examples/own-dbc/train.toml", 20),
        (ROOT / "tests/data/dbc/third-party.toml", 40),  # extended, Motorola
    ],
)
def test_kit_passes_its_tests(train: Path | str | None, known: int, tmp_path: Path) -> None:
    made = {"odd": odd_train, "twin": twin_train}
    folder = written(tmp_path / "kit", made[train](tmp_path) if isinstance(train, str) else train)
    assert known_frames(make(folder, "FRAMES=200000" if train == "twin" else "FRAMES=20000")) >= known


@pytest.mark.night
def test_million_random_frames_pass_the_sanitizers(default: Path) -> None:
    said = make(default, "sanitize")
    found = re.search(r"1000000 random frames, seed 1: (\d+) accepted, (\d+) times FRESH_VALID", said)
    assert found, said
    assert int(found[1]) > 100_000
    assert int(found[2]) > 10_000
    one, other = (make(default, "FRAMES=5000", f"SEED={seed}") for seed in (1, 2))
    assert one != other.replace("seed 2", "seed 1")


def test_kit_of_a_message_of_64_bytes_passes_its_tests_under_the_sanitizers(tmp_path: Path) -> None:
    message, output = fd_message()
    found = kit_message(message, output, 3, "odd.toml")
    assert (found.is_fd, found.length) == (True, 64)
    for name, content in files_of([found], "0" * 64, "a test").items():
        (tmp_path / name).write_bytes(content)
    assert known_frames(make(tmp_path, "sanitize", "FRAMES=20000")) >= 20


def test_example_for_socketcan_takes_a_number_of_seconds_and_nothing_else(default: Path) -> None:
    make(default, "example")
    cases = {"-1": True, "nan": True, "inf": True, "1e30": True, "1s": True, "1 2": True, "": False, "2.5": False}
    for words, refused in cases.items():
        command = [str(default / "example_socketcan"), "no-such-bus", *words.split()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)
        assert (done.returncode == 2) == refused, words
        assert done.stderr.startswith("usage:") == refused


def test_frame_is_used_at_once_and_not_when_it_waited_in_the_examples_queue(default: Path, config: Config) -> None:
    frame = turn(messages(config)[0])[0].hex()
    program = build(default, "queue")
    late = run(program, [f"{ms} {ADHESION_A1:x} {frame}" for ms in (61, 200)])
    assert late == [TIMED_OUT, TIMED_OUT]
    soon = run(program, [f"0 {ADHESION_A1:x} {frame}"] * 20)  # a busy computer takes one of them away
    assert "0" in soon


def test_call_of_the_readme_does_what_the_page_says_and_stands_in_the_docs(
    default: Path, config: Config, tmp_path: Path
) -> None:
    fence = re.search(r"^```c\n(.*?)^```$", (default / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    assert fence
    assert fence[1] in (ROOT / "docs/how-to/run-on-an-ecu.md").read_text()
    cases = {
        "Valid": ["limit 2045"], "Confidence Wider": ["keep"], "Degraded": ["fall back"], "NotAvailable": ["fall back"],
        "ContactState Saturated": ["limit 2045", "no more"],
    }  # fmt: skip
    frames = {v.what: v.data for v in vectors(messages(config)[0])}
    rows = "".join(f"    {{{byte_list(frames[what])}}},\n" for what in cases)
    program = tmp_path / "call.c"
    program.write_text(
        '#include "adhesion.h"\n#include <stdio.h>\n'
        f"static const uint8_t FRAMES[][8] = {{\n{rows}}};\n"
        "static uint64_t time_us = 0U;\nstatic uint64_t now_us(void) { return time_us; }\n"
        'static void limit_demand_to(uint16_t lower_end) { printf("limit %u,", lower_end); }\n'
        'static void keep_limit(void) { printf("keep,"); }\nstatic void fall_back(void) { printf("fall back,"); }\n'
        'static void ask_for_no_more(void) { printf("no more,"); }\n'
        "static void step(uint32_t id, uint8_t flags, uint8_t length, const uint8_t *data)\n{\n"
        f"{fence[1]}}}\n"
        "int main(void)\n{\n    for (unsigned at = 0U; at < sizeof FRAMES / 8U; at++) {\n"
        f"        time_us += 1000000U;\n        step({ADHESION_A1}U, 0U, 8U, FRAMES[at]);\n"
        '        printf("\\n");\n    }\n    return 0;\n}\n'
    )
    command = [COMPILERS[0], *WARNINGS, "-I", default, "-o", tmp_path / "call", program, default / "adhesion.c"]
    subprocess.run([str(word) for word in command], timeout=60, check=True)
    assert [line.split(",")[:-1] for line in run(tmp_path / "call", [])] == list(cases.values())


def test_crc_agrees_with_frames_that_others_have_protected(default: Path) -> None:
    rows = [line.split(",") for line in VECTORS.read_text().split()[1:]]
    assert len(rows) >= 20
    said = run(build(default, "crc"), [f"{data_id} {frame}" for data_id, _, frame in rows])
    assert said == [frame[:2] for _, _, frame in rows]


def compare(program: Path, config: Config, frames: Sequence[Frame]) -> Counter[Verdict]:
    """Every frame's verdict by the receiver and by the reading. Returns what was seen."""
    reading, seen = Reading(config, DEFAULT_US), Counter[Verdict]()
    asked = [line for _, line in lines(config, frames)]
    for f, line, said in zip(frames, asked, run(program, asked), strict=True):
        verdict = reading.feed(f)
        assert int(said.split()[0]) == verdict, (line, seen.total())
        seen[verdict] += 1
    return seen


def test_receiver_judges_a_recorded_stream_as_the_daemons_checker_does(
    default: Path, config: Config, tmp_path: Path
) -> None:
    log = tmp_path / "sent.log"
    assert main(["replay", str(ROOT / "tests/golden/leaf-film.log"), "-o", str(log)]) == 0
    sent = [f for f, _ in read_log(log, Damage()) if 0x91 <= f.can_id <= 0x94]
    program = build(default, "feed")
    assert compare(program, config, sent)[Verdict.ACCEPTED] > 100
    longer = [replace(f, stamp_us=f.stamp_us + 5_000_000 * k) for k in range(8) for f in sent]
    assert set(compare(program, config, disturbed(longer, seed=3))) == set(Verdict)


def test_receiver_follows_counters_of_two_senders_as_the_daemons_checker_does(default: Path, config: Config) -> None:
    seen = compare(build(default, "feed"), config, counted(config, 6_000, seed=6))
    assert {Verdict.ACCEPTED, Verdict.ANEW, Verdict.COUNTER, Verdict.REPEAT, Verdict.TWO_SENDERS} <= set(seen)
