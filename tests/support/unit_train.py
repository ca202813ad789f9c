"""The package and its unit under a real systemd, and a train whose sensors canplayer plays."""

import subprocess
import time
from contextlib import ExitStack
from pathlib import Path

from tests.support.processes import ROOT, running, wait_for
from tests.support.vcan import CANDUMP
from wrcd.bus.candump import parse_line
from wrcd.bus.frame import Frame
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

UNIT = "wrcd@vcan0"
# made by tests/hil/unit-env
BUILT = ROOT / "build/unit"
PLAYED = BUILT / "dry.log"


def output(*words: str) -> str:
    return subprocess.run(words, timeout=60, check=True, capture_output=True, text=True).stdout.strip()


def package(folder: Path = BUILT) -> Path:
    """The Debian package in a folder: this version's, or that of BUILT / "older"."""
    (file,) = folder.glob("wrcd_*.deb")
    return file


def dpkg(folder: Path, file: Path) -> list[str]:
    """dpkg with a database in a folder, of what a package needs: to read this machine's takes ten seconds in the
    guest."""
    (folder / "updates").mkdir()
    (folder / "info").mkdir()
    needed = output("dpkg-deb", "--field", str(file), "Depends")
    contents = output("dpkg-deb", "--contents", str(file))
    names = [word.split()[0] for word in needed.split(", ")]
    # so that it knows them for folders of others: it removes its own where they are empty
    folders = {line.split()[-1][1:].rstrip("/") or "/." for line in contents.splitlines() if line.startswith("d")}
    (folder / "info/systemd.list").write_text("".join(f"{f}\n" for f in sorted(folders) if Path(f).is_dir()))
    (folder / "status").write_text("\n".join(output("dpkg-query", "--status", name) + "\n" for name in names))
    return ["dpkg", "--admindir", str(folder)]


def systemctl(*words: str) -> str:
    return output("systemctl", *words)


def prop(name: str, unit: str = UNIT) -> str:
    """A property of the unit, as systemctl show prints it."""
    return systemctl("show", "-p", name, "--value", unit)


def main_pid() -> int:
    return int(prop("MainPID"))


def journal(since_s: float = 0.0) -> str:
    return output("journalctl", "-u", UNIT, "--no-pager", f"--since=@{since_s:.3f}")


def validity(frame: Frame) -> int:
    return frame.data[1] >> 4


VALID, NOT_AVAILABLE = 1, 0


class Train:
    """Frames of a wet rail without end (unit-env has played minutes of it), and what candump hears of Adhesion_A1."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._stack = ExitStack()
        self._logs = 0

    def connect(self) -> None:
        """Both ends at the bus, from now on with a new log."""
        self.disconnect()
        self._logs += 1
        self.log = self._folder / f"candump{self._logs}.log"
        self._stack.enter_context(running(*CANDUMP, "vcan0,091:7FF", output=self.log))
        # a train's sensors do not wait for the daemon's processor: in the guest they share the only one
        self._stack.enter_context(running("chrt", "-f", "10", "canplayer", "-l", "i", "-I", PLAYED, "vcan0=can0"))

    def disconnect(self) -> None:
        self._stack.close()

    def newest(self) -> Frame | None:
        """The last Adhesion_A1 frame that candump has written."""
        with self.log.open("rb") as f:
            f.seek(max(0, self.log.stat().st_size - 2000))
            lines = [parse_line(line.strip()) for line in f.read().splitlines()[1:]]
        return next((found[0] for found in reversed(lines) if found is not None), None)

    def since(self, since_s: float) -> list[Frame]:
        """Every Adhesion_A1 frame after a moment."""
        return [f for f, _ in read_log(self.log, Damage()) if f.stamp_us * 1e-6 > since_s]

    def wait(self, since_s: float, wanted: int = VALID, seconds: float = 60.0) -> None:
        """Until a frame after a moment has this Validity."""

        def there() -> bool:
            frame = self.newest()
            return frame is not None and frame.stamp_us * 1e-6 > since_s and validity(frame) == wanted

        wait_for(f"a frame with Validity {wanted}", seconds, there)

    def back_after(self, what: str, since_s: float, unseen_s: float) -> float:
        """Seconds from a moment to the first Valid frame that is no longer the old daemon's; printed."""
        time.sleep(unseen_s)  # no looking meanwhile: it would take the one processor
        self.wait(since_s + 0.1)
        first_s = next(f.stamp_us * 1e-6 for f in self.since(since_s + 0.1) if validity(f) == VALID) - since_s
        print(f"{what}: Valid again after {first_s:.2f} s")
        return first_s
