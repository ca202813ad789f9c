"""`wrcd check --installation`: what this computer has for the daemon and its tools, and the line that mends what it
lacks. It reads files, opens a socket and asks `ip`; it changes nothing."""

import importlib.util
import json
import platform
import resource
import shutil
import socket
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from wrcd import __version__, native
from wrcd.config.config import load_config
from wrcd.errors import InputError, install_hint

ARPHRD_CAN = "280"  # <linux/if_arp.h>
RECEIVE_BYTES = 8_388_608  # systemd/80-wrcd.conf
# by extra, a package that it brings and nothing else of wrcd does
EXTRAS = {
    "monitor": "textual", "report": "bokeh", "mf4": "asammdf", "mcap": "mcap", "bench": "numba", "campaign": "pyarrow",
    "learned": "sklearn",
}  # fmt: skip
UNITS = ("etc/systemd/system", "usr/lib/systemd/system", "lib/systemd/system")


class InstalledPart(NamedTuple):
    """What there is of a part; is_fine: None where it is only wanted sometimes. mend: what to do, else."""

    name: str
    found: str
    is_fine: bool | None
    mend: str = ""


def parts(root: Path) -> Iterator[InstalledPart]:
    """Yield every part, an interface and a configuration each once. root: of the file system."""
    yield InstalledPart("wrcd", f"{__version__}, Python {platform.python_version()}, {Path(__file__).parents[2]}", True)
    try:
        yield InstalledPart("library in C", f"compiled by {native.compiler()}", True)
    except InputError as e:
        yield InstalledPart("library in C", e.reason, False, e.hint)
    yield _kernel()
    yield from _interfaces(root)
    most = root / "proc/sys/net/core/rmem_max"
    held = int(most.read_text()) if most.exists() else 0
    mend = f"sysctl -w net.core.rmem_max={RECEIVE_BYTES}; for good: systemd/80-wrcd.conf to /etc/sysctl.d"
    yield InstalledPart("receive buffer", f"{held} bytes at most", True if held >= RECEIVE_BYTES else None, mend)
    yield from _rights()
    for extra, package in EXTRAS.items():
        is_there = importlib.util.find_spec(package) is not None
        yield InstalledPart(
            f"extra {extra}", "installed" if is_there else "not installed", is_there or None, install_hint(extra)
        )
    yield from _service(root)


def _kernel() -> InstalledPart:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as e:
        return InstalledPart(
            "CAN in the kernel", e.strerror or str(e), False, "as root: modprobe can_raw; in a container, on its host"
        )
    return InstalledPart("CAN in the kernel", "SocketCAN", True)


def _interfaces(root: Path) -> Iterator[InstalledPart]:
    kinds = sorted((root / "sys/class/net").glob("*/type"))
    names = [kind.parent.name for kind in kinds if kind.read_text().strip() == ARPHRD_CAN]
    if not names:
        yield InstalledPart(
            "CAN interface", "none", None, "as root: ip link add vcan0 type vcan; a real one needs its driver"
        )
    for name in names:
        state, rate = (root / f"sys/class/net/{name}/operstate").read_text().strip(), _bit_rate(name)
        is_up = state in ("up", "unknown")  # vcan has no carrier to know of
        mend = f"as root: ip link set {name} up" + ("" if rate is None else " type can bitrate 500000")
        yield InstalledPart("CAN interface", f"{name} {'up' if is_up else state}{rate or ''}", is_up or None, mend)


def _bit_rate(name: str) -> str | None:
    """In words; None for an interface without one, as vcan, and where there is no `ip` to ask."""
    ip = shutil.which("ip")
    if ip is None:
        return None
    done = subprocess.run([ip, "-json", "-details", "link", "show", name], capture_output=True, text=True, check=False)
    try:
        info = json.loads(done.stdout)[0]["linkinfo"]
        rate = info.get("info_data", {}).get("bittiming", {}).get("bitrate")
        return None if info["info_kind"] != "can" else f", {rate} bit/s" if rate else ", no bit rate"
    except (ValueError, LookupError):
        return None


def _rights() -> Iterator[InstalledPart]:
    priority, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    locked, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    mend = "for a busy computer: wrcd@.service.d/realtime.conf; systemd gives the unit both"
    yield InstalledPart(
        "real-time rights",
        f"priority up to {priority}" if priority else "none of this user",
        bool(priority) or None,
        mend,
    )
    words = "without limit" if locked == resource.RLIM_INFINITY else f"{locked // 1024} kB"
    yield InstalledPart("locked memory", words, locked == resource.RLIM_INFINITY or None, mend)


def _service(root: Path) -> Iterator[InstalledPart]:
    units = [root / folder / "wrcd@.service" for folder in UNITS]
    there = next((unit for unit in units if unit.exists()), None)
    mend = "make deb; dpkg -i build/deb/wrcd_*.deb; systemctl enable --now wrcd@can0"
    yield InstalledPart("unit", "none" if there is None else str(there), True if there else None, mend)
    files = sorted((root / "etc/wrcd").glob("*.toml"))
    for file in files:
        try:
            config = load_config(file)
            yield InstalledPart(
                "configuration", f"{file}: axles {', '.join(str(a.number) for a in config.axles)}", True
            )
        except InputError as e:
            yield InstalledPart("configuration", f"{file} does not hold", False, f"wrcd check --config {file}: {e}")
    if not files:
        yield InstalledPart(
            "configuration",
            "the packaged one",
            None,
            "for a train of your own: wrcd init TRAIN.dbc -o /etc/wrcd/can0.toml",
        )


def lines(found: Iterable[InstalledPart]) -> Iterator[str]:
    """Yield a line for each part, and below it what mends it."""
    for part in found:
        mark = {True: "ok", False: "MISSING", None: "-"}[part.is_fine]
        yield f"{mark:8}{part.name:19}{part.found}"
        if part.is_fine is not True and part.mend:
            yield f"{'':27}{part.mend}"


def report(root: Path = Path("/")) -> bool:
    """Print it. Returns whether the daemon can run here."""
    found = list(parts(root))
    for line in lines(found):
        print(line)
    return all(part.is_fine is not False for part in found)
