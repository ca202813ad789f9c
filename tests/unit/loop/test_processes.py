"""The loop of docs/how-to/close-the-loop.md as three processes on one bus, and a fourth that keeps what was on it. The
figures of a stop are judged in lockstep."""

import json
import os
import re
import subprocess
from pathlib import Path

from tests.support.can_ids import ADHESION_A1, YAW_RATE_A1
from tests.support.loop_wire import SHORT
from tests.support.own_network import own_network
from tests.support.pages import run_by
from tests.support.processes import BIN
from wrcd.config.config import packaged
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

DEMAND_A1, DRIVER_DEMAND = 0x141, 0x131
# Each in its turn, as on the page; what is started here is ended here, should one of them fail
SCRIPT = """
trap 'kill $logs $daemon $controller 2>/dev/null; wait' EXIT
python -m can.logger {bus} -f bus.log >/dev/null 2>&1 & logs=$!
{daemon} --config one.toml 2>daemon & daemon=$!
until grep -q ' {adhesion:03X}#' bus.log; do kill -0 $daemon; sleep .1; done
{controller} --config one.toml 2>controller & controller=$!
until grep -q DriverDemand controller; do kill -0 $controller; sleep .1; done
{drive} --json out.json
kill $controller
wait $controller
sleep .3
kill $daemon
wait $daemon
"""


def test_three_processes_of_the_page_drive_to_the_end(tmp_path: Path) -> None:
    prefix, bus = own_network()
    (step,) = run_by("tests/unit/loop/test_processes.py", "docs/how-to/close-the-loop.md")
    commands = [c.replace("-i socketcan ", "").replace("-c vcan0", bus) for c in step.commands]
    daemon, controller, drive = commands
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "one.toml").write_text(packaged(1))
    text = SCRIPT.format(
        bus=bus, daemon=daemon, controller=controller, drive=drive.replace("emergency-greasy", "short.toml"),
        adhesion=ADHESION_A1,
    )  # fmt: skip
    env = os.environ | {"PATH": f"{BIN}:{os.environ['PATH']}", "PYTHONUNBUFFERED": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [*prefix, "bash", "-euc", text], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    document = json.loads((tmp_path / "out.json").read_text())
    assert document["over"]
    assert document["unsent"] == document["bus"]["foreign_frames"] == 0
    assert document["demand"]["1"]["heard"]
    # a process that is held up leaves cycles out: of more than two the next frame is rejected
    assert {why for why, n in document["demand"]["1"]["rejected"].items() if n} <= {"counter"}
    assert "has not come yet" in (tmp_path / "controller").read_text()
    for name in ("controller", "daemon"):
        assert "somebody else" not in (tmp_path / name).read_text()
    ids = [f.can_id for f, _ in read_log(tmp_path / "bus.log", Damage())]
    assert {ADHESION_A1, YAW_RATE_A1, DEMAND_A1} <= set(ids)
    # the controller demands nothing before it has heard the driver
    assert ids.index(DRIVER_DEMAND) < ids.index(DEMAND_A1)
    accepted = r"stopped; (\d+) frames accepted, rejected: (none|\d+ counter);"
    told = re.search(accepted, (tmp_path / "daemon").read_text())
    assert told is not None
    assert int(told[1]) > 0
