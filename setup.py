"""What pyproject.toml cannot say: the library in C11, which Python loads with ctypes. One build serves every Python.

It takes $CC or cc; where there is none, zig's, which pip fetches for the build. WRCD_MACHINE asks for zig's, for the
machine that it names: `make wheels`. Where nothing compiles, nothing is installed.
"""

import os
import platform
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext

sys.path.insert(0, str(Path(__file__).parent))  # this tree's wrcd, whichever is installed

from wrcd.native import sources as digest

MACHINE = os.environ.get("WRCD_MACHINE")
CC = shlex.split(os.environ.get("CC") or "cc")
ZIG = bool(MACHINE) or not shutil.which(CC[0])
if ZIG:  # by its target it takes no instruction that only this processor has, and binds to the C library of 2012
    CC = [sys.executable, "-m", "ziglang", "cc", "-target", f"{MACHINE or platform.machine()}-linux-gnu.2.17"]
FLAGS = ["-std=c11", "-O3", "-g0", "-ffp-contract=off", "-fPIC", "-fno-semantic-interposition", "-shared"]
FLAGS += ["-Wall", "-Wextra", "-Wconversion"]


class Library(build_ext):
    """One file for every Python, and none of the flags that each was built with."""

    def get_ext_filename(self, fullname: str) -> str:
        """Return a name without Python's version."""
        return f"{fullname.replace('.', '/')}.so"

    def build_extension(self, ext: Extension) -> None:
        """Compile and link. Raises SystemExit with what to do."""
        library = Path(self.get_ext_fullpath(ext.name))
        library.parent.mkdir(parents=True, exist_ok=True)
        macros = [f"-D{name}={value}" for name, value in ext.define_macros]
        folders = [f"-I{folder}" for folder in ext.include_dirs]
        try:
            subprocess.run([*CC, *FLAGS, *macros, *folders, *ext.sources, "-o", library, "-lm"], check=True)
        except (OSError, subprocess.CalledProcessError) as e:
            raise SystemExit(f"wrcd: {shlex.join(CC)} does not compile: install gcc and libc6-dev, or a wheel") from e


class Wheel(bdist_wheel):
    """The wheel of one machine, for every Python."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return Python, ABI and platform."""
        machine = MACHINE or platform.machine()
        manylinux = f"manylinux_2_17_{machine}.manylinux2014_{machine}"
        return "py3", "none", manylinux if ZIG else super().get_tag()[2]


sources = [str(p) for p in sorted(Path().glob("wrcd/*/c/*"))]
setup(
    ext_modules=[
        Extension(
            "wrcd._native",
            [name for name in sources if name.endswith(".c")],
            depends=sources,
            define_macros=[("WRCD_SOURCES", f'"{digest()}"')],
            include_dirs=sorted({str(Path(name).parent) for name in sources}),
        )
    ],
    cmdclass={"build_ext": Library, "bdist_wheel": Wheel},
    setup_requires=["ziglang"] if ZIG else [],
    options={"build_ext": {"force": True}},  # a source that is gone leaves none that is newer
)
