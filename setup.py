"""What pyproject.toml cannot say: the core in C11, one library that Python loads with ctypes.

No header of Python's is needed, only a C compiler. Without one nothing is installed.
"""

import sys
from pathlib import Path

from setuptools import Extension, setup

sys.path.insert(0, str(Path(__file__).parent))  # this tree's wrcd, whichever is installed

from wrcd.native import sources as digest

sources = [str(p) for p in sorted(Path().glob("wrcd/*/c/*"))]
setup(
    ext_modules=[
        Extension(
            "wrcd._native",
            [name for name in sources if name.endswith(".c")],
            depends=sources,
            define_macros=[("WRCD_SOURCES", f'"{digest()}"')],
            extra_compile_args=["-std=c11", "-O3", "-g0", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion"],
            include_dirs=sorted({str(Path(name).parent) for name in sources}),
            libraries=["m"],
        )
    ],
    options={"build_ext": {"force": True}},  # a source that is gone leaves none that is newer
)
