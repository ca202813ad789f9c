"""The receiver in C of a kit: it compiles without a warning, passes its own tests, and reads as we do."""

import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1
from tests.support.kit.building import COMPILERS, WARNINGS, build, make, needs_compiler, run, written
from tests.support.kit.reading import Reading, Verdict, Why
from tests.support.kit.streams import counted, disturbed, lines, made
from tests.support.kit.trains import fd_message, odd_train, twin_train
from tests.support.pages import ROOT
from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, read_log
from wrcd.config import load_config
from wrcd.core.configuration import Config
from wrcd.tools.cli import main
from wrcd.tools.kit.model import kit_message, messages
from wrcd.tools.kit.run import files_of
from wrcd.tools.kit.tables import byte_list
from wrcd.tools.kit.vectors import turn, vectors

pytestmark = needs_compiler
VECTORS = ROOT / "tests/data/e2e_profile11_vectors.csv"
# As the DBCs and the configurations say.
DEFAULT_US = dict.fromkeys(range(1, 5), 60_000)
ODD_US = {1: 90_000, 7: 150_000}


@pytest.fixture(scope="module")
def default(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("default"))


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Config]:
    folder = tmp_path_factory.mktemp("odd")
    config_file = odd_train(folder)
    return written(folder / "kit", config_file), load_config(config_file)


def known_frames(said: str) -> int:
    found = re.search(r"(\d+) known frames, \d+ checks, 0 failed", said)
    assert found, said
    return int(found[1])


def test_kit_of_the_default_configuration_passes_its_tests(default: Path) -> None:
    assert known_frames(make(default, "FRAMES=20000")) >= 4 * 20


def test_million_random_frames_pass_the_sanitizers(default: Path) -> None:
    said = make(default, "sanitize")
    found = re.search(r"1000000 random frames, seed 1: (\d+) accepted, (\d+) times FRESH_VALID", said)
    assert found, said
    assert int(found[1]) > 100_000
    assert int(found[2]) > 10_000


def test_another_seed_gives_other_random_frames(default: Path) -> None:
    one, other = (make(default, "FRAMES=5000", f"SEED={seed}") for seed in (1, 2))
    assert one != other.replace("seed 2", "seed 1")


def test_kit_of_odd_messages_passes_its_tests(odd: tuple[Path, Config]) -> None:
    assert known_frames(make(odd[0], "FRAMES=20000")) >= 2 * 20


def test_kit_of_the_example_with_an_own_dbc_passes_its_tests(tmp_path: Path) -> None:
    folder = written(tmp_path / "kit", ROOT / "examples/own-dbc/train.toml")
    assert known_frames(make(folder, "FRAMES=20000")) >= 20


def test_kit_of_extended_motorola_messages_passes_its_tests(tmp_path: Path) -> None:
    folder = written(tmp_path / "kit", ROOT / "tests/data/dbc/third-party.toml")
    assert known_frames(make(folder, "FRAMES=20000")) >= 2 * 20


def test_kit_of_ids_that_differ_in_one_bit_or_in_their_kind_passes_its_tests(tmp_path: Path) -> None:
    folder = written(tmp_path / "kit", twin_train(tmp_path))
    assert known_frames(make(folder, "FRAMES=200000")) >= 4 * 10


def test_kit_of_a_message_of_64_bytes_passes_its_tests_under_the_sanitizers(tmp_path: Path) -> None:
    message, output = fd_message()
    found = kit_message(message, output, 3, "odd.toml")
    assert (found.is_fd, found.length) == (True, 64)
    for name, content in files_of([found], "0" * 64, "a test").items():
        (tmp_path / name).write_bytes(content)
    assert known_frames(make(tmp_path, "sanitize", "FRAMES=20000")) >= 20


def test_example_for_socketcan_takes_a_number_of_seconds_and_nothing_else(default: Path) -> None:
    make(default, "example")
    for words in (["-1"], ["nan"], ["inf"], ["1e30"], ["1s"], [""], ["1", "2"]):
        done = subprocess.run(
            [default / "example_socketcan", "no-such-bus", *words],
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
        )
        assert (done.returncode, done.stderr.partition(":")[0]) == (2, "usage"), words
    for words in ([], ["0"], ["2.5"], ["1e9"]):
        assert (
            subprocess.run([default / "example_socketcan", "no-such-bus", *words], timeout=10, check=False).returncode
            != 2
        )


def test_frame_that_waited_in_the_examples_queue_is_as_old_as_it_is(default: Path, config: Config) -> None:
    frame = turn(messages(config)[0])[0].hex()
    said = run(build(default, "queue"), [f"{ms} {ADHESION_A1:x} {frame}" for ms in (61, 200)])
    assert [Why(int(reason)) for reason in said] == [Why.TIMED_OUT, Why.TIMED_OUT]


def test_frame_that_is_read_at_once_is_used(default: Path, config: Config) -> None:
    frame = turn(messages(config)[0])[0].hex()
    said = run(build(default, "queue"), [f"0 {ADHESION_A1:x} {frame}"] * 20)  # a busy computer takes one of them away
    assert str(Why.NO_REASON.value) in said


def test_call_of_the_readme_does_what_the_page_says_and_stands_in_the_docs(
    default: Path, config: Config, tmp_path: Path
) -> None:
    fence = re.search(r"^```c\n(.*?)^```$", (default / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    assert fence
    assert fence[1] in (ROOT / "docs/how-to/write-a-receiver.md").read_text()
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


def test_fields_say_how_long_a_second_sender_just_ahead_is_used(default: Path) -> None:
    """test_adhesion.c counts them."""
    assert "up to three of its frames are used" in (default / "fields.md").read_text()


@pytest.mark.parametrize("train", ["default", "odd"])
def test_receiver_breaks_no_rule_of_the_contract(
    train: str, default: Path, odd: tuple[Path, Config], tmp_path: Path
) -> None:
    kit, own = (default, []) if train == "default" else (odd[0], ["--wrcd-config", odd[1].file])
    library = tmp_path / "libadhesion.so"
    shared = [COMPILERS[0], *WARNINGS, "-O2", "-shared", "-fPIC", "-o", library, kit / "adhesion.c"]
    subprocess.run([str(word) for word in shared], timeout=60, check=True)
    receiver = f"{ROOT / 'tests/support/kit/consumer.py'}:Receiver"
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-c", "/dev/null", "--pyargs",
         "wrcd.tools.contract.checks", "--wrcd-object", receiver, *own],
        cwd=ROOT, env={**os.environ, "KIT_LIBRARY": str(library)}, capture_output=True, text=True, timeout=120,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    passed = re.search(r"(\d+) passed", done.stdout)
    assert passed
    assert int(passed[1]) >= 30


def test_crc_agrees_with_frames_that_others_have_protected(default: Path) -> None:
    rows = [line.split(",") for line in VECTORS.read_text().split()[1:]]
    assert len(rows) >= 20
    said = run(build(default, "crc"), [f"{data_id} {frame}" for data_id, _, frame in rows])
    assert said == [frame[:2] for _, _, frame in rows]


def compare(program: Path, config: Config, timeouts_us: dict[int, int], frames: Sequence[Frame]) -> Counter[object]:
    """Every frame's verdict, and what is to be used then, by the receiver and by the reading. Returns what was seen."""
    reading, seen = Reading(config, timeouts_us), Counter[object]()
    asked = lines(config, frames)
    for f, (axle, line), said in zip(frames, asked, run(program, [line for _, line in asked]), strict=True):
        verdict = reading.feed(f)
        use = reading.poll(axle, f.stamp_us)
        assert [*map(int, said.split())] == [verdict, *use], (line, seen.total())
        seen.update((verdict, Why(use[1])))
    return seen


def test_receiver_judges_a_recorded_stream_as_the_daemons_checker_does(
    default: Path, config: Config, tmp_path: Path
) -> None:
    log = tmp_path / "sent.log"
    assert main(["replay", str(ROOT / "tests/golden/leaf-film.log"), "-o", str(log)]) == 0
    sent = [f for f, _ in read_log(log, Damage()) if 0x91 <= f.can_id <= 0x94]
    program = build(default, "feed")
    assert compare(program, config, DEFAULT_US, sent)[Why.NO_REASON] > 100
    seen = compare(program, config, DEFAULT_US, disturbed(sent, seed=3))
    assert {Verdict.CRC, Verdict.REPEAT, Verdict.AFTER_GAP, Verdict.LENGTH, Verdict.KIND} <= set(seen)


def test_receiver_judges_all_that_may_be_said_as_the_daemons_checker_does(default: Path, config: Config) -> None:
    frames = disturbed(made(config, 40.0, seed=1), seed=2)
    seen = compare(build(default, "feed"), config, DEFAULT_US, frames)
    assert set(Verdict) - set(seen) == set()
    assert set(Why) - set(seen) <= {Why.VALIDITY}


def test_receiver_follows_counters_of_two_senders_as_the_daemons_checker_does(default: Path, config: Config) -> None:
    seen = compare(build(default, "feed"), config, DEFAULT_US, counted(config, 6_000, seed=6))
    assert {Verdict.ACCEPTED, Verdict.ANEW, Verdict.COUNTER, Verdict.REPEAT, Verdict.TWO_SENDERS} <= set(seen)
    assert min(seen[Why.NO_REASON], seen[Why.SENDERS], seen[Why.MANY_DROPS]) > 100


def test_receiver_reads_odd_messages_as_cantools_does(odd: tuple[Path, Config]) -> None:
    folder, config = odd
    frames = disturbed(made(config, 80.0, seed=4), seed=5)
    seen = compare(build(folder, "feed"), config, ODD_US, frames)
    assert {Verdict.ACCEPTED, Verdict.AFTER_GAP, Verdict.ANEW, Verdict.CRC, Verdict.TWO_SENDERS} <= set(seen)
    assert {Why.NO_REASON, Why.MU, Why.SAMPLE_AGE, Why.CONFIDENCE, Why.NO_CLASS, Why.DEGRADED} <= set(seen)
