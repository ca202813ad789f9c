"""What is laid out on a computer, and where: one list for `wrcd install` and for the Debian package."""

import gzip
import hashlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from wrcd import resources

BUILT_FOR = "/opt/wrcd/bin"  # where the unit files of the repository expect the programs
CONFIGURATIONS = "etc/wrcd"  # made for a person to fill
# What is laid out on request only: a bit rate that is not the train's, or simulated sensors on the train's bus, would
# do harm.
GROUPS = {
    "can0": "bit rate (500 kbit/s) and recovery from bus-off of can0, for systemd-networkd",
    "vcan0": "a virtual bus vcan0, for systemd-networkd",
    "realtime": "SCHED_FIFO and locked memory for every wrcd@ unit",
    "rig": "sim-ecu@.service, which plays simulated sensors onto a bus (extra bench)",
}


@dataclass(frozen=True, slots=True)
class Places:
    """Folders from the root on, without the first slash."""

    programs: str
    units: str
    sysctl: str
    network: str
    man: str
    bash: str
    zsh: str
    examples: str
    rig: bool  # whether the program there may have the packages that the rig needs


# For what a package manager does not look after. An administrator's own files in /etc go first.
LOCAL = Places(
    programs="usr/local/bin",
    units="usr/local/lib/systemd/system",
    sysctl="etc/sysctl.d",
    network="etc/systemd/network",
    man="usr/local/share/man",
    bash="usr/local/share/bash-completion/completions",
    zsh="usr/local/share/zsh/site-functions",
    examples="usr/local/share/doc/wrcd/examples",
    rig=True,
)
DEBIAN = Places(
    programs="usr/bin",
    units="usr/lib/systemd/system",
    sysctl="etc/sysctl.d",
    network="etc/systemd/network",
    man="usr/share/man",
    bash="usr/share/bash-completion/completions",
    zsh="usr/share/zsh/vendor-completions",
    examples="usr/share/doc/wrcd/examples",
    rig=False,
)


@dataclass(frozen=True, slots=True)
class Laid:
    """A file or, with a target, a symbolic link as it is to lie there."""

    content: bytes = b""
    target: str = ""

    @property
    def checksum(self) -> str:
        """SHA-256 (hex) of what is in it; for a link "-> " and its target."""
        return f"-> {self.target}" if self.target else hashlib.sha256(self.content).hexdigest()


def lay_out(
    layout: Places,
    program: PurePosixPath,
    groups: Collection[str] = (),
    data: Path = resources.DATA,
    systemd: Path | None = None,
) -> dict[str, Laid]:
    """Return every file by its path from the root on, without the first slash.

    program: the `wrcd` that units start; `sim-ecu` lies beside it. groups: names of GROUPS. data: the package's data;
    systemd: unit files of another version instead of those in it.
    """
    units = systemd or data / "systemd"
    laid: dict[str, Laid] = {}
    for name, group, path in _systemd(layout):
        if group in (None, *groups):
            laid[path] = Laid(_with_program((units / name).read_bytes(), program))
    for file in sorted((*_folder(data / "man"), *_folder(data / "completion"))):
        place = _place(layout, file)
        if place and ("rig" in groups or not file.name.lstrip("_").startswith("sim-ecu")):
            content = file.read_bytes()
            laid[place] = Laid(gzip.compress(content, 9, mtime=0) if place.endswith(".gz") else content)
    for name in ("wrcd", "sim-ecu") if "rig" in groups else ("wrcd",):
        if str(program.with_name(name)) != f"/{layout.programs}/{name}":
            laid[f"{layout.programs}/{name}"] = Laid(target=str(program.with_name(name)))
    return laid


def _systemd(layout: Places) -> Iterator[tuple[str, str | None, str]]:
    """Name in the package, group (None: always), and path of each file of systemd/."""
    yield "wrcd@.service", None, f"{layout.units}/wrcd@.service"
    yield "80-wrcd.conf", None, f"{layout.sysctl}/80-wrcd.conf"
    yield "sim-ecu@.service", "rig", f"{layout.units}/sim-ecu@.service"
    yield "wrcd@.service.d/realtime.conf", "realtime", f"{layout.units}/wrcd@.service.d/realtime.conf"
    for name, group in (("80-can0.network", "can0"), ("80-vcan0.netdev", "vcan0"), ("80-vcan0.network", "vcan0")):
        yield name, group, f"{layout.network}/{name}"
        yield name, None, f"{layout.examples}/{name}"
    for name in ("realtime.conf", "device.conf"):
        yield f"wrcd@.service.d/{name}", None, f"{layout.examples}/wrcd@.service.d/{name}"
    if layout.rig:
        yield "sim-ecu@.service", None, f"{layout.examples}/sim-ecu@.service"


def _with_program(text: bytes, program: PurePosixPath) -> bytes:
    return text.replace(f"{BUILT_FOR}/".encode(), f"{program.parent}/".replace("//", "/").encode())


def _folder(folder: Path) -> list[Path]:
    return [file for file in folder.iterdir() if file.is_file()] if folder.is_dir() else []


def _place(layout: Places, file: Path) -> str:
    """Where a manual page or a completion goes; empty for anything else."""
    if file.parent.name == "man":
        section = file.suffix[1:]
        return f"{layout.man}/man{section}/{file.name}.gz" if section.isdigit() else ""
    if file.suffix == ".bash":
        return f"{layout.bash}/{file.stem}"
    return f"{layout.zsh}/{file.name}" if file.name.startswith("_") and not file.suffix else ""
