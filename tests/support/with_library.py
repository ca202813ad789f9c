"""Run a module with another library in C: python -m tests.support.with_library LIBRARY MODULE [ARGUMENT ...]."""

import runpy
import sys
from pathlib import Path

from wrcd import native

if __name__ == "__main__":
    _, file, module, *sys.argv[1:] = sys.argv
    loaded = native.load(Path(file))
    vars(native)["library"] = lambda: loaded  # before any other module takes it by its name
    runpy.run_module(module, run_name="__main__", alter_sys=True)
