"""Exit statuses: every command has a table, and does what it says."""

import errno
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_ecu.cli import main as rig_cli
from sim_ecu.resources import TRUTH_DBC
from tests.support.scenarios import LogOf, held
from tests.support.statuses import STATUSES
from wrcd import resources
from wrcd.cli import main as cli
from wrcd.cli.program import Program, guarded
from wrcd.config.config import DEFAULT
from wrcd.errors import BusError, InputError, NotThere, Status

# by command: arguments and the status that they end with. {log}, {dbc}, {dir}: a recorded log, the packaged DBC, a
# folder to write to;
# here.toml is a sound configuration, bad.toml is not, late.toml names a DBC that is not there; cut.log and {cut}
# end in mid-line, foreign.log has nothing that is mapped.
WRCD_CASES = [
    ("run --config bad.toml", 2),
    ("run --wait -1", 2),
    ("run -i virtual -c x --config never.toml", 3),
    ("run -i virtual -c x --config late.toml", 3),
    ("run -i socketcan -c can77", 3),
    ("run -i pcan -c x", 3),
    ("init {dbc}", 0),
    ("init {dbc} -o here.toml", 2),
    ("init never.dbc", 2),
    ("lint {dbc}", 0),
    ("lint {truth}", 1),
    ("lint bad.dbc", 2),
    ("lint never.dbc", 2),
    ("kit -o {dir}/kit", 0),
    ("kit -o {dir}/kit --config bad.toml", 2),
    ("kit -o here.toml", 2),
    ("kit -o {dir}/kit --config never.toml", 3),
    ("check", 0),
    ("check --config here.toml", 0),
    ("check --log {log} --config here.toml", 1),
    ("check --config bad.toml", 2),
    ("check --config never.toml", 3),
    ("check --config late.toml", 3),
    ("check --config .", 3),
    ("dump {log}", 0),
    ("dump cut.log", 1),
    ("dump {log} --config bad.toml", 2),
    ("dump never.log", 2),
    ("dump -i socketcan -c can77", 3),
    ("dump {log} --dbc never.dbc", 3),
    ("monitor {log}", 2),
    ("replay {log} --csv {dir}/a.csv", 0),
    ("replay {cut} --csv {dir}/a.csv", 1),
    ("replay foreign.log --csv {dir}/a.csv", 3),
    ("replay never.log", 2),
    ("replay {log} --design nowhere", 2),
    ("replay {log} --design never.json", 2),
    ("replay {log} --config bad.toml", 2),
    ("replay {log} --config late.toml", 2),
    ("replay {log} {log2} --csv {dir}/both --config never.toml", 2),
    ("report {log} -o {dir}/a.html", 0),
    ("report {cut} -o {dir}/a.html", 1),
    ("report never.log", 2),
    ("report {log} -o here.toml", 2),
    ("report {log} --against bad.json -o {dir}/a.html", 2),
    ("report {log} --plot {dir}/a.png", 0),
    ("report {cut} --plot {dir}/a.svg", 1),
    ("report foreign.log --plot {dir}/a.png", 2),
    ("report {log} --plot here.toml", 2),
    ("why {log} 2", 0),
    ("why {cut} 2", 1),
    ("why {log} 2000", 2),
    ("why {log} 2 --axle 7", 2),
    ("why never.log 2", 2),
]
RIG_CASES = [
    ("list", 0),
    ("play short.toml --fast --log {dir}/a.log", 0),
    ("play nowhere", 2),
    ("play short.toml --fast", 2),
    ("play never.toml", 3),
    ("play short.toml -c can77", 3),
    ("play short.toml --fault crc:at=0.1,for=0.1,of=yaw_rate,axle=1 --fast --log {dir}/a.log", 0),
    ("play short.toml --fault crash:at=0.1", 2),
    ("play short.toml --fault crc:at=0.1 -c can77", 3),
    ("drive stop.toml -i virtual -c drive-status", 0),
    ("drive nowhere", 2),
    ("drive never.toml", 3),
    ("drive stop.toml -c can77", 3),
    ("control none -i virtual -c control-status --for 0.1", 0),
    ("control none --for -1", 2),
    ("control none -c can77", 3),
    ("design --explain", 0),
    ("design", 2),
    ("design --explain never.json", 3),
    ("design --explain nowhere", 2),
    ("design -o {dir}/t --search noise --budget 0", 2),
    ("design -o {dir}/t --search noises", 2),
    ("design -o {dir}/t --search noise --config never.toml", 3),
    ("calibrate never.log --known known.toml -o {dir}/m.toml", 2),
    ("calibrate {log} --known known.toml -o {dir}/m.toml", 2),
    ("calibrate {log} --known never.toml -o {dir}/m.toml", 3),
    ("score --jobs 0", 2),
    ("score --quick --design never.json", 3),
    ("score --quick --beside a=nowhere", 2),
    ("campaign asked.toml --dry-run", 0),
    ("campaign asked.toml", 2),
    ("campaign never.toml -o {dir}/c", 2),
    ("figures -o {dir}/f --design bad.json", 2),
    ("figures -o {dir}/f --design never.json", 3),
    ("figures -o {dir}/f --design nowhere", 2),
    ("demo --scenario nowhere", 2),
    ("demo --scenario never.toml", 3),
]
STOP = 'title = "t"\nduration_s = 0.2\nspeed_m_s = 12\nrail = [{ curve = "A" }]\ndriver = { demand = -1.0 }\n'
LATE = '[dbc]\nfile = "never.dbc"\n[wheelset]\nname = "multiple-unit"\n' + DEFAULT
CASES = [("wrcd", *c) for c in WRCD_CASES] + [("sim-ecu", *c) for c in RIG_CASES]
MAINS: dict[str, Callable[[list[str]], int]] = {"wrcd": cli.main, "sim-ecu": rig_cli.main}


@pytest.mark.parametrize("program", [cli.WRCD, rig_cli.SIM_ECU], ids=lambda p: p.name)
def test_every_command_has_a_table(program: Program) -> None:
    assert set(STATUSES[program.name]) == {c.name for c in program.commands()} == set(program.names)


@pytest.fixture
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("here.toml").write_text(DEFAULT)
    Path("bad.toml").write_text("[axles]\n")
    Path("late.toml").write_text(LATE)
    Path("foreign.log").write_text("(1700000000.000000) can0 7FF#00\n")
    Path("cut.log").write_text("(1700000000.000000) can0 7FF#00\n(1700000000.000100) can0 7F")
    Path("bad.dbc").write_text("BO_ no DBC at all")
    Path("bad.json").write_text("{}")
    Path("short.toml").write_text(held("A", 0.5))
    Path("stop.toml").write_text(STOP)
    Path("known.toml").write_text('vehicle = "multiple-unit"\n')
    Path("asked.toml").write_text('kind = "play"\n[factor]\nscenario = ["dry"]\n')


@pytest.mark.usefixtures("_folder")
@pytest.mark.parametrize(("program", "line", "status"), CASES, ids=[f"{p} {c}" for p, c, _ in CASES])
def test_command_ends_with_the_status_of_its_table(
    program: str, line: str, status: int, log_of: LogOf, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = log_of(held("F"))
    again = tmp_path / "again.log"
    if "{log2}" in line:
        again.write_bytes(log.read_bytes())
    if "{cut}" in line:
        again.write_bytes(log.read_bytes()[:-9])
    name, *arguments = line.format(
        log=log, log2=again, cut=again, dbc=resources.DBC, truth=TRUTH_DBC, dir=tmp_path
    ).split()
    assert MAINS[program]([name, *arguments]) == status
    assert Status(status) in STATUSES[program][name]
    error = capsys.readouterr().err
    if status in (2, 3):
        assert f"{program}: error: " in error
        assert "Traceback" not in error


@pytest.mark.parametrize(
    ("kind", "status"), [(InputError, 2), (NotThere, 3), (BusError, 3)], ids=["bad input", "not there", "bus"]
)
def test_error_is_one_line_and_its_status(
    kind: type[InputError], status: int, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails() -> int:
        raise kind("is wrong", file="a.toml", line=3, key="axle", hint="mend it")

    assert guarded("wrcd", fails) == status
    assert guarded("wrcd", fails, retried=False) == 2
    assert capsys.readouterr().err == "wrcd: error: a.toml:3: axle: is wrong — mend it\n" * 2


def test_ctrl_c_is_130() -> None:
    def interrupted() -> int:
        raise KeyboardInterrupt

    assert guarded("wrcd", interrupted) == int(Status.INTERRUPTED) == 130


# an import, as it is now and then: the exception is lost, and the command goes on
LOSES_CTRL_C = """
import os, signal, sys
from wrcd.cli.program import guarded

def command():
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt:
        pass
    return 5

sys.exit(guarded("wrcd", command, own_signals=bool(int(sys.argv[1]))))
"""


@pytest.mark.parametrize(("own", "status"), [(1, -signal.SIGINT), (0, 5)])
def test_ctrl_c_during_the_start_of_a_command_with_its_own_handler_is_not_lost(own: int, status: int) -> None:
    assert subprocess.run([sys.executable, "-c", LOSES_CTRL_C, str(own)], timeout=60).returncode == status


def test_own_signals_leave_the_handler_as_it_was() -> None:
    seen = []

    def command() -> int:
        seen.append(signal.getsignal(signal.SIGINT))
        return 0

    before = signal.getsignal(signal.SIGINT)
    try:
        for handler in (signal.default_int_handler, signal.SIG_IGN):
            signal.signal(signal.SIGINT, handler)
            assert guarded("wrcd", command, own_signals=True) == 0
            assert signal.getsignal(signal.SIGINT) is handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [signal.SIG_DFL, signal.SIG_IGN]


def test_unit_tries_again_after_every_status_but_bad_input_and_waits_for_less_than_systemd_gives_it() -> None:
    unit = (Path(__file__).parents[3] / "systemd/wrcd@.service").read_text()
    assert f"\nRestartPreventExitStatus={Status.BAD_INPUT:d}\n" in unit
    assert "\nRestart=always\n" in unit
    wait_s, timeout_s = (
        float(re.findall(p, unit, re.MULTILINE)[0]) for p in (r"^ExecStart=.* --wait (\S+)", r"^TimeoutStartSec=(\d+)s")
    )
    assert wait_s <= timeout_s - 10.0  # the slow imports of a small computer come before, the rest of the start after


FULL = Path("/dev/full")
FILLS = ("dump {log}", "replay {log}", "replay {log} --csv {full}", "replay {log} -o {full}", "why {log} 2", "check")


@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full")
@pytest.mark.parametrize("line", FILLS)
def test_full_disk_is_one_line_and_1(line: str, log_of: LogOf) -> None:
    command = [sys.executable, "-m", "wrcd.cli", *line.format(log=log_of(held("F")), full=FULL).split()]
    with FULL.open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    errors = [x for x in done.stderr.splitlines() if "warning: " not in x]
    assert done.returncode == Status.STOPPED
    assert len(errors) == 1
    assert errors[0].startswith("wrcd: error: the output cannot be written to its end: No space left on device")


# the output's reader has gone before a line is written; the lines are many, or few enough to stay in a buffer
CLOSED = """
import os, sys
from wrcd.cli.program import guarded

lines, streams = map(int, sys.argv[1:])
reader, writer = os.pipe()
os.close(reader)
os.dup2(writer, 1)

def command():
    for _ in range(lines):
        print("a line of a page that somebody reads")
    return 1

sys.exit(guarded("wrcd", command, streams=bool(streams)))
"""


@pytest.mark.parametrize(
    ("lines", "streams", "status"), [(10, 0, 1), (100_000, 0, Status.PIPE_CLOSED), (100_000, 1, 0), (10, 1, 1)]
)
def test_status_of_a_command_whose_reader_closes_the_pipe_is_its_own_or_141(
    lines: int, streams: int, status: int
) -> None:
    """Never the 0 of a check that is fine."""
    command = [sys.executable, "-c", CLOSED, str(lines), str(streams)]
    env = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, env=env)
    assert (done.returncode, done.stderr) == (status, "")


def test_other_mistake_of_the_system_keeps_its_traceback() -> None:
    def fails() -> int:
        raise OSError(errno.EINVAL, "Invalid argument")

    with pytest.raises(OSError, match="Invalid argument"):
        guarded("wrcd", fails)
