"""The core in C of a kit: it compiles without a warning, makes of frames what wrcd makes of them, and fails where it
does not; of every layout of a DBC, on this processor, on a 32-bit Arm and on a 64-bit one."""

import ctypes
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.corpus.recipes import FLOATS, ODD, configuration
from tests.support.kit.building import COMPILERS, make, needs_compiler, run_make, written
from tests.support.kit.trains import odd_train
from tests.support.pages import ROOT, run_by
from tests.support.tools import needs
from wrcd import __version__
from wrcd.bus.mapping import Mapped
from wrcd.bus.reasons import Reason
from wrcd.config.config import load_config
from wrcd.core.core import Core
from wrcd.core.design import Design
from wrcd.core.design_members import Member, OverSpeed, members
from wrcd.core.state import TABLES
from wrcd.core.tables import tables_of
from wrcd.errors import InputError
from wrcd.kit.core_files import MADE, SOURCES
from wrcd.kit.design_table import DesignTable
from wrcd.kit.golden_frames import frames
from wrcd.kit.golden_track import TICKS, track
from wrcd.kit.write_kit import core_kit

PAGE = "docs/how-to/run-on-an-ecu.md"
SAYS = re.compile(rf"{TICKS} ticks of (\d) axles?, .* (\d+) Valid, largest difference (\S+): as wrcd\n")
STACK = re.compile(r"^stack (\d+) bytes; it may be 49152$", re.MULTILINE)
ZIG = ROOT / "build/zig/ziglang/zig"
CONFIGS = (ODD, FLOATS, "tests/data/dbc/third-party.toml", "examples/own-dbc/train.toml")


@pytest.fixture(scope="module")
def default(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("core"), core=True)


@pytest.fixture(scope="module")
def built(default: Path) -> tuple[Path, str]:
    """A kit with its objects, and what its test said."""
    folder = Path(shutil.copytree(default, default.parent / f"{default.name}-built"))
    return folder, make(folder)


@pytest.fixture
def copied(built: tuple[Path, str], tmp_path: Path) -> Path:
    """A built kit to be changed."""
    return Path(shutil.copytree(built[0], tmp_path / "copy"))


def eight_axles(folder: Path, design: str = "multiple-unit") -> Path:
    file = folder / "eight.toml"
    file.write_text(configuration(8, design))
    return file


def judge(said: str, axles: int) -> None:
    """What a test prints that went well: axles, difference, stack."""
    found, stack = SAYS.search(said), STACK.search(said)
    assert found, said
    assert int(found[1]) == axles
    assert int(found[2]) > 50
    assert float(found[3]) <= 1e-9
    assert stack, said
    assert 10_000 < int(stack[1]) <= 49_152  # the bank's matrices alone are 11 kB


@needs_compiler
def test_core_makes_what_wrcd_makes(built: tuple[Path, str]) -> None:
    judge(built[1], axles=4)


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_compiler_builds_it_without_a_warning(compiler: str, copied: Path) -> None:
    judge(make(copied, "-B", f"CC={compiler}", "CFLAGS=-O1 -Wpedantic"), axles=4)


@needs_compiler
@pytest.mark.parametrize("file", CONFIGS)
def test_any_layout_of_a_dbc_becomes_tables(file: str, tmp_path: Path) -> None:
    config = ROOT / file
    judge(make(written(tmp_path, config, core=True)), len(load_config(config).axles))


@needs_compiler
@pytest.mark.parametrize("train", [odd_train, eight_axles])
def test_train_of_two_axles_and_of_eight(train: Any, tmp_path: Path) -> None:
    config = train(tmp_path)
    judge(make(written(tmp_path / "kit", config, core=True)), len(load_config(config).axles))


@needs_compiler
def test_papers_form_of_a_design(tmp_path: Path) -> None:
    config = eight_axles(tmp_path, str(ROOT / "sim_ecu/data/lone-wheelset.paper.design.json"))
    said = make(written(tmp_path / "kit", config, core=True))
    found = SAYS.search(said)
    assert found, said
    assert float(found[3]) <= 1e-9


@needs_compiler
def test_sanitizers_find_nothing(copied: Path) -> None:
    assert SAYS.search(make(copied, "sanitize"))


def unhurried(core: Path) -> None:
    """Let a tick take all of its time: beside other work an emulator needs its own twice over."""
    test, limit = core / "test_core.c", "#define MAX_SHARE 0.1"
    assert limit in test.read_text()
    test.write_text(test.read_text().replace(limit, "#define MAX_SHARE 1.0"))


@needs("arm-linux-gnueabihf-gcc", "qemu-arm")
def test_core_makes_the_same_on_a_32_bit_arm(copied: Path) -> None:
    (step,) = run_by("tests/unit/kit/test_kit_core.py", PAGE)
    (command,) = step.commands
    unhurried(copied)
    judge(make(copied, *command.removeprefix("make -C core ").split()), axles=4)


@pytest.mark.night
@needs("qemu-aarch64")
@pytest.mark.parametrize(("machine", "run"), [("x86_64", ""), ("aarch64", "qemu-aarch64")])
def test_core_makes_the_same_by_zig_here_and_on_aarch64(machine: str, run: str, copied: Path) -> None:
    if not ZIG.exists():
        pytest.skip("ziglang missing; make build/zig/bin/cc")
    unhurried(copied)
    judge(make(copied, "-B", f"CC={ZIG} cc -target {machine}-linux-musl", f"RUN={run}"), axles=4)
    (copied / "cpp.cpp").write_text('#include "train.h"\nint main() { static wrcd_memory m; wrcd_train_of(&m); }\n')
    subprocess.run([ZIG, "c++", "-std=c++11", "-c", "cpp.cpp"], cwd=copied, check=True)


@needs_compiler
def test_page_says_what_it_takes(built: tuple[Path, str]) -> None:
    page = (ROOT / PAGE).read_text()
    shown = re.search(r"^```text\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert shown

    def lasting(said: str) -> list[str]:  # not times, stack and difference
        lines = [line for line in said.splitlines() if not line.startswith(("make", "cc", "./", "a tick", "stack"))]
        return [line.split(", largest")[0] for line in lines]

    assert lasting(built[1]) == lasting(shown[1])
    usual, most = re.findall(r"about (\d+)", (built[0] / "README.md").read_text())
    assert f"takes {usual} multiply-adds in double precision for four axles, {most} at most" in page


@needs_compiler
def test_example_sends_every_message_that_is_due(copied: Path) -> None:
    sent = re.findall(r"^id 0x(\w{3}):((?: \w\w)+)$", make(copied, "example"), re.MULTILINE)
    config = load_config(None)
    of_axles = [a.adhesion for a in config.axles]
    assert [int(i, 16) for i, _ in sent].count(0x091) == 6  # each 20 ms for 0.1 s, and the last
    assert len(sent) > 6 * len(of_axles)
    assert all(len(data.split()) == 8 for _, data in sent)


@needs_compiler
@pytest.mark.parametrize(
    ("file", "was", "becomes"),
    [
        ("vectors.h", r"(\{\d+\.\d{6})\d", r"\g<1>"),  # what wrcd said
        ("vectors.h", r"(GIVEN.*\n.*\{\d+, \d+U, \d, 0, 0, \{)\d+", r"\g<1>1"),  # what it was given
        ("train.c", r"(ADHESION|POLYNOMIAL)(\[7\] = \{\s+)-?\d", r"\1\g<2>9"),
        ("train.c", r"\.timeout_us = \d+", ".timeout_us = 1000"),
        ("parts.h", "MIN_FIRING = 0.05", "MIN_FIRING = 0.9"),
        ("core.h", "COUNTER_MODULO = 15", "COUNTER_MODULO = 14"),
    ],
)
def test_difference_is_found(file: str, was: str, becomes: str, copied: Path) -> None:
    text = (copied / file).read_text()
    changed = re.sub(was, becomes, text, count=1)
    assert changed != text
    (copied / file).write_text(changed)
    done = run_make(copied)
    assert done.returncode == 2
    assert "NOT as wrcd" in done.stdout
    assert re.search(r"^frame \d+, [a-z ]+: \S+, not \S+$", done.stdout, re.MULTILINE)


@needs_compiler
@pytest.mark.parametrize("limit", ["MAX_STACK=20000U", "MAX_SHARE=1e-7"])
def test_more_stack_or_time_than_is_allowed_is_found(limit: str, copied: Path) -> None:
    done = run_make(copied, "-W", "test_core.c", f"CFLAGS=-O2 -D{limit}")
    assert done.returncode == 2
    assert SAYS.search(done.stdout)


def test_files_name_version_and_design_and_the_sources_are_wrcds_own(default: Path) -> None:
    design = load_config(None).design
    assert {f.name for f in default.iterdir()} == {*SOURCES, *MADE}
    for name in (*SOURCES, *MADE):
        head, _, body = (default / name).read_text().partition("\n")
        assert f"written by wrcd kit {__version__}; core: " in head
        assert f"multiple-unit wrcd-design/5 {design.checksum};" in head
        assert not re.search("@[A-Z_]+@", body), name
        if name in SOURCES:
            own = SOURCES[name].read_text()
            assert body == own.replace("WRCD_MAX_AXLES = 8", "WRCD_MAX_AXLES = 4"), name
    assert (default / "vectors.h").stat().st_size < 600_000


def test_kit_of_another_kind_is_not_overwritten(tmp_path: Path) -> None:
    written(tmp_path)
    with pytest.raises(InputError, match="--force"):
        core_kit(tmp_path, None, False)
    core_kit(tmp_path, None, True)
    core_kit(tmp_path, None, False)


def numbers_of(of: Member) -> list[NDArray[Any]]:
    if isinstance(of, dict):
        return [a for value in of.values() for a in numbers_of(value)]
    if isinstance(of, OverSpeed | tuple):
        return [a for value in of for a in numbers_of(value)]
    return [of.ravel()] if isinstance(of, np.ndarray) else []


def test_design_has_every_number_to_the_last_bit() -> None:
    design: Design = load_config(None).design
    table = DesignTable(members(design)).text
    said = {tuple(map(float, body.split(",")[:-1])) for body in re.findall(r"\] = \{\n(.*?)\}", table, re.DOTALL)}
    arrays = [tuple(a.tolist()) for a in numbers_of(members(design))]
    assert len(arrays) > 30
    assert [a for a in arrays if a not in said and f"{{{', '.join(map(repr, a))}}}" not in table] == []


@needs_compiler
@pytest.mark.parametrize("file", [*CONFIGS, ""])
def test_tables_are_the_cores_own_to_the_last_bit(file: str, tmp_path: Path) -> None:
    config_file = ROOT / file if file else eight_axles(tmp_path)  # with eight axles settings have no other length
    folder, config = written(tmp_path / "kit", config_file, core=True), load_config(config_file)
    library, more = (
        folder / "tables.so",
        "void tables(void **at) { const wrcd_train t = wrcd_train_of((void *)at); memcpy(at, &t, sizeof t); }",
    )
    (folder / "more.c").write_text(f'#include <string.h>\n#include "train.h"\n{more}\n')
    subprocess.run([COMPILERS[0], "-shared", "-fPIC", "train.c", "more.c", "-o", library], cwd=folder, check=True)
    at = (ctypes.c_void_p * 20)()
    ctypes.CDLL(str(library)).tables(at)
    tables = tables_of(config, Mapped(config.database, [i.source for i in config.inputs], config.data_ids))
    for name, address in zip(TABLES, at, strict=False):
        if name != "settings" or len(config.axles) == 8:
            assert address
            assert ctypes.string_at(address, tables[name].nbytes) == tables[name].tobytes(), name


def test_golden_frames_have_what_is_refused_and_a_drop_of_adhesion() -> None:
    config = load_config(None)
    mapped = Mapped(config.database, [i.source for i in config.inputs], config.data_ids)
    core, ticks = Core(config), track(config.design, len(config.axles))
    found: list[float] = []
    for k, of_tick in enumerate(frames(config, mapped, ticks)):
        core.feed(of_tick)
        core.advance((ticks.number + k + 1) * 5000)
        found += [r.mu_available_pct for r in core.reports[1:2] if r.validity == "Valid" and r.mu_available_pct]
    assert {Reason.CRC, Reason.REPEAT, Reason.KIND, Reason.LENGTH} <= set(core.counts.rejected)
    assert core.counts.restarts > 0
    assert max(found) > 1.5 * min(found)
