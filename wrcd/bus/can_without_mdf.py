"""python-can without asammdf, which it imports where there is one, and with it pandas: half a second of each start.

Only a log in MDF needs that. Whoever has loaded python-can already keeps what it has.
"""

import importlib
import sys
from typing import Any

_MDF = "asammdf"
if not {"can", _MDF} & set(sys.modules):
    modules: dict[str, Any] = sys.modules  # with None in it a module is not found
    modules[_MDF] = None
    try:
        importlib.import_module("can.io.mf4")
    finally:
        del modules[_MDF]


def prepare(suffix: str) -> None:
    """Let python-can read and write logs of a suffix."""
    mf4 = sys.modules.get("can.io.mf4")
    if suffix == ".mf4" and mf4 is not None and mf4.asammdf is None:
        importlib.reload(mf4)
