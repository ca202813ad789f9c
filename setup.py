"""What pyproject.toml cannot say: the estimator in C11, one library that Python loads with ctypes.

No header of Python's is needed, only a C compiler. Without one the build goes on, and the reference in numpy runs.
"""

import runpy
from pathlib import Path

from setuptools import Extension, setup

sources = [str(p) for p in sorted(Path().glob("wrcd/*/c/*"))]
compiled_from = runpy.run_path("wrcd/native.py")["sources"]()
setup(
    ext_modules=[
        Extension(
            "wrcd._native",
            [name for name in sources if name.endswith(".c")],
            depends=sources,
            define_macros=[("WRCD_SOURCES", f'"{compiled_from}"')],
            extra_compile_args=["-std=c11", "-O3", "-g0", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion"],
            include_dirs=sorted({str(Path(name).parent) for name in sources}),
            libraries=["m"],
            optional=True,
        )
    ],
    options={"build_ext": {"force": True}},  # a source that is gone leaves none that is newer
)
