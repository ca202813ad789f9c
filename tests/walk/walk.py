"""A walk: the user's folder, what the user types there, and what a step prints."""

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
OUT = ROOT / "build" / "walk"


class StepFailed(Exception):
    """What a user would have stumbled over."""


def expect(met: bool, otherwise: str) -> None:
    """Fail the step with a sentence unless the condition is met. An assert would vanish under python -O."""
    if not met:
        raise StepFailed(otherwise)


@dataclass(frozen=True, slots=True)
class Walk:
    """folder is the clone; pictures and screens go to out, each named after its step."""

    folder: Path
    out: Path = OUT

    @property
    def env(self) -> dict[str, str]:
        """The environment of the commands: a user's, without what this run has set for itself."""
        left_out = ("PYTHON", "MAKE", "MFLAGS", "COVERAGE", "PYTEST", "VIRTUAL_ENV", "NO_COLOR", "CAN_")
        return {k: v for k, v in os.environ.items() if not k.startswith(left_out)} | {"LANG": "C.UTF-8"}

    def run(self, *command: str | Path, seconds: float = 120.0, status: int = 0) -> str:
        """Run a command in the clone; return what it says. Its exit status is checked, and its time is bounded."""
        typed = " ".join(map(str, command))
        try:
            done = subprocess.run(
                [str(c) for c in command], cwd=self.folder, env=self.env, stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=seconds,
            )  # fmt: skip
        except subprocess.TimeoutExpired as e:
            raise StepFailed(f"`{typed}` did not end within {seconds:g} s") from e
        if done.returncode != status:
            said = "\n".join(done.stdout.splitlines()[-30:])
            raise StepFailed(f"`{typed}` ended with {done.returncode}, not {status}:\n{said}")
        return done.stdout

    def wrcd(self, *arguments: str | Path, seconds: float = 120.0, status: int = 0) -> str:
        """Run the clone's wrcd."""
        return self.run(".venv/bin/wrcd", *arguments, seconds=seconds, status=status)

    def sim_ecu(self, *arguments: str | Path, seconds: float = 120.0, status: int = 0) -> str:
        """Run the clone's sim-ecu."""
        return self.run(".venv/bin/sim-ecu", *arguments, seconds=seconds, status=status)


def played(walk: Walk) -> Path:
    """A log with the rig's and the daemon's frames, in the clone: the demo's, or one made now if it was not taken."""
    demo = Path("build/demo/leaf-patch.log")
    if not (walk.folder / demo).exists():
        (walk.folder / demo.parent).mkdir(parents=True, exist_ok=True)
        walk.sim_ecu("play", "leaf-patch", "--fast", "--log", demo)
    return demo


@dataclass(frozen=True, slots=True)
class Step:
    """A step; take returns what is seen, in one line with its figures."""

    name: str
    take: Callable[[Walk], str]
    tools: tuple[tuple[str, str], ...] = ()  # programs that it needs, each with its Debian package
    on_vcan: bool = False

    def lacking(self) -> list[str]:
        """What this machine lacks for it."""
        found = [f"{tool} is missing; install Debian's package {p}" for tool, p in self.tools if not shutil.which(tool)]
        if self.on_vcan:
            ask = (str(ROOT / "tests/hil/guest/run"), "--lacks", "--native-ok")
            found += subprocess.run(ask, capture_output=True, text=True, check=True).stdout.splitlines()
        return found


def take(steps: list[Step], walk: Walk) -> int:
    """Take the steps one after the other, a line each. Returns 1 at the first that fails, and names it. A step whose
    program is missing is left out; with NO_SKIPS=1 it fails, and without the clone there is no walk."""
    began = time.monotonic()
    for step in steps:
        at = time.monotonic()
        try:
            lacking = step.lacking()
            if lacking and not os.environ.get("NO_SKIPS"):
                print(*(f"left out: step {step.name}: {what}" for what in lacking), sep="\n", flush=True)
                if step is steps[0]:
                    return 0
                continue
            expect(not lacking, "; ".join(lacking))
            seen = step.take(walk)
        except StepFailed as e:
            print(f"walk: step {step.name} failed: {e}", flush=True)
            return 1
        except Exception as e:
            print(f"walk: step {step.name} failed: {type(e).__name__}: {e}", flush=True)
            raise
        print(f"{step.name:10} {time.monotonic() - at:5.1f} s  {seen}", flush=True)
    print(f"walked in {time.monotonic() - began:.0f} s; pictures and screens are in {walk.out}")
    return 0
