"""Tests on a real kernel's vcan0."""

import shutil
import socket
from pathlib import Path

import pytest


def pytest_configure(config: pytest.Config) -> None:
    missing = [tool for tool in ("candump", "cansend", "canplayer") if shutil.which(tool) is None]
    if not hasattr(socket, "AF_CAN") or not Path("/sys/class/net/vcan0").exists() or missing:
        raise pytest.UsageError(
            "these tests need vcan0 and can-utils; run them with `make test`, or "
            "`tests/hil/guest/run --native-ok -- .venv/bin/python -m pytest tests/hil/test_vcan.py`"
        )
