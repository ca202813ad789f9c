"""`wrcd check --installation`: what this computer has for the daemon and its tools, and the line that mends what it
lacks. It reads files, opens a socket and asks `ip`; it changes nothing."""

import importlib.util
import json
import os
import platform
import re
import shlex
import shutil
import socket
import subprocess
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from wrcd import __version__, native
from wrcd.config.config import load_config
from wrcd.errors import InputError, install_hint

ARPHRD_CAN, IFF_UP = "280", 1  # <linux/if_arp.h>, <linux/if.h>
RECEIVE_BYTES = 8_388_608  # systemd/80-wrcd.conf
ASKED_S = 5.0  # what `ip` is given to answer
# by extra, a package that it brings and nothing else of wrcd does
EXTRAS = {
    "monitor": "textual", "report": "bokeh", "mf4": "asammdf", "mcap": "mcap", "bench": "numba", "campaign": "pyarrow",
    "learned": "sklearn",
}  # fmt: skip
UNITS = ("etc/systemd/system", "usr/lib/systemd/system", "lib/systemd/system")
REAL_TIME = re.compile(r"^CPUSchedulingPolicy=(fifo|rr)$", re.MULTILINE)
SETTING = re.compile(r"^\s*(WRCD_OPTIONS|SCENARIO)\s*=\s*(.*?)\s*$", re.MULTILINE)


class InstalledPart(NamedTuple):
    """What there is of a part. is_fine: False where the daemon cannot run so, None where it can. mend: what to do."""

    name: str
    found: str
    is_fine: bool | None
    mend: str = ""


def parts(root: Path) -> Iterator[InstalledPart]:
    """Yield every part; an interface and a configuration each have one. root: of the file system."""
    yield InstalledPart("wrcd", f"{__version__}, Python {platform.python_version()}, {Path(__file__).parents[2]}", True)
    yield InstalledPart("library in C", f"compiled by {native.compiler()}", True)  # without it nothing is imported
    yield _kernel()
    yield from _interfaces(root)
    try:
        held = int((root / "proc/sys/net/core/rmem_max").read_text())
        mend = f"sysctl -w net.core.rmem_max={RECEIVE_BYTES}; for good: systemd/80-wrcd.conf to /etc/sysctl.d"
        yield InstalledPart("receive buffer", f"{held} bytes at most", held >= RECEIVE_BYTES or None, mend)
    except OSError as e:
        yield InstalledPart("receive buffer", f"its limit cannot be read: {e.strerror}", None)
    for extra, package in EXTRAS.items():
        is_there = importlib.util.find_spec(package) is not None
        words = "installed" if is_there else "not installed"
        yield InstalledPart(f"extra {extra}", words, is_there or None, install_hint(extra))
    candump = shutil.which("candump")
    yield InstalledPart("candump", candump or "none", bool(candump) or None, "apt install can-utils, to see frames")
    yield from _units(root)
    yield from _configurations(root / "etc/wrcd")


def _kernel() -> InstalledPart:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as e:
        mend = "as root: modprobe can_raw; in a container, on its host; to try wrcd: make vcan -- COMMAND"
        return InstalledPart("CAN in the kernel", e.strerror or str(e), False, mend)
    return InstalledPart("CAN in the kernel", "SocketCAN", True)


def _interfaces(root: Path) -> Iterator[InstalledPart]:
    names = []
    for folder in sorted((root / "sys/class/net").glob("*")):
        try:
            if (folder / "type").read_text().strip() == ARPHRD_CAN:
                is_up = bool(int((folder / "flags").read_text(), 16) & IFF_UP)
                names.append((folder.name, is_up, (folder / "operstate").read_text().strip()))
        except OSError:  # it has just gone
            continue
    if not names:
        mend = "as root: ip link add vcan0 type vcan; a real one needs its driver"
        yield InstalledPart("CAN interface", "none", None, mend)
    for name, is_up, state in names:
        rate = _bit_rate(name)
        mend = f"as root: ip link set {name} up" + " type can bitrate RATE" * (rate == NO_RATE)
        if is_up and state == "down":
            yield InstalledPart(
                "CAN interface", f"{name} is up, its controller is not: bus-off?{rate}", None, f"ip -d link show {name}"
            )
        else:
            yield InstalledPart("CAN interface", f"{name} {'up' if is_up else 'down'}{rate}", is_up or None, mend)


NO_RATE = ", no bit rate"


def _bit_rate(name: str) -> str:
    """In words; nothing for an interface without one, as vcan, and where `ip` does not say."""
    ip = shutil.which("ip")
    try:
        command = (ip or "ip", "-json", "-details", "link", "show", name)
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=ASKED_S)
        info = json.loads(done.stdout)[0]["linkinfo"]
        rate = info.get("info_data", {}).get("bittiming", {}).get("bitrate")
        return "" if info["info_kind"] != "can" else f", {rate} bit/s" if rate else NO_RATE
    except (OSError, subprocess.TimeoutExpired, ValueError, LookupError):
        return ""


def _units(root: Path) -> Iterator[InstalledPart]:
    there = next((unit for folder in UNITS if (unit := root / folder / "wrcd@.service").exists()), None)
    mend = "make deb; dpkg -i build/deb/wrcd_*.deb; systemctl enable --now wrcd@can0"
    yield InstalledPart("unit", "none" if there is None else str(there), there is not None or None, mend)
    drop_ins = sorted((root / "etc/systemd/system").glob("wrcd@*.service.d/*.conf"))
    found = next((file for file in drop_ins if REAL_TIME.search(file.read_text(errors="replace"))), None)
    mend = "for a busy computer: the example wrcd@.service.d/realtime.conf"
    yield InstalledPart("real-time priority", "none" if found is None else str(found), found is not None or None, mend)


def _configurations(folder: Path) -> Iterator[InstalledPart]:
    files, named = configurations(folder)
    for file in files:
        if not os.access(file, os.R_OK):
            yield InstalledPart("configuration", f"{file} cannot be read", None, "as root, or is not there")
            continue
        try:
            axles = ", ".join(str(a.number) for a in load_config(file).axles)
            used = "" if file in named else "; no .env file names it"
            yield InstalledPart("configuration", f"{file}: axles {axles}{used}", True)
        except InputError as e:
            yield InstalledPart("configuration", f"{file} is refused", False, f"wrcd check --config {file}\n{e}")
    if not files:
        mend = f"for a train of your own: wrcd init TRAIN.dbc -o {folder}/can0.toml, and can0.env names it"
        yield InstalledPart("configuration", "the packaged one", None, mend)


def configurations(folder: Path) -> tuple[list[Path], set[Path]]:
    """Return the configurations of a folder, each once: the TOML files in it that are no scenario of the rig, and what
    WRCD_OPTIONS of an .env file there gives with --config; and which of them an .env file names. What a unit's drop-in
    gives is not seen."""
    named, scenarios = set[Path](), set[Path]()
    for file in sorted(folder.glob("*.env")):
        # systemd goes on after a backslash at a line's end
        text = file.read_text(encoding="utf-8", errors="replace").replace("\\\n", "")
        for name, value in SETTING.findall(text):
            if value[:1] in ("'", '"') and value[-1:] == value[:1]:
                value = value[1:-1]
            if name == "SCENARIO":
                scenarios.add(folder / value)
            else:
                named.update(folder / config for config in _given(value))
    return sorted({*folder.glob("*.toml"), *named} - (scenarios - named)), named


def _given(options: str) -> list[str]:
    """What --config is given. Nothing where quotes do not end."""
    try:
        words = shlex.split(options)
    except ValueError:
        return []
    found = [word.partition("=")[2] for word in words if word.startswith("--config=")]
    return found + [after for word, after in pairwise(words) if word == "--config"]


def lines(found: Iterable[InstalledPart]) -> Iterator[str]:
    """Yield a line for each part, and below it what mends it."""
    for part in found:
        mark = {True: "ok", False: "NO", None: "-"}[part.is_fine]
        yield f"{mark:4}{part.name:20}{part.found}"
        if part.is_fine is not True:
            yield from (f"{'':24}{line}" for line in part.mend.splitlines())


def report(root: Path = Path("/")) -> bool:
    """Print it. Returns whether no part says that the daemon cannot run here."""
    found = list(parts(root))
    for line in (*lines(found), "NO: the daemon cannot run so. -: where you want it."):
        print(line)
    return all(part.is_fine is not False for part in found)
