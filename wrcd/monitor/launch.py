"""`wrcd monitor`: from its arguments to the screen."""

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from wrcd.bus.dbc import load_dbc
from wrcd.config.config import load_config
from wrcd.errors import InputError
from wrcd.logs.bus_of import pick_bus
from wrcd.logs.statistics import BIT_RATE
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.sources import FrameSource, NoMore, ReaderProcess, model_of_log, open_source


def monitor(
    log: Path | None, config_file: Path | None, interface: str | None, channel: str | None,
    dbc_files: Sequence[Path] = (), bit_rate: int | None = None,
) -> int:  # fmt: skip
    """Show until a key ends it. Returns the exit status. Raises InputError where there is nothing to show."""
    if find_spec("textual") is None:
        raise InputError("needs the extra monitor", key="monitor", hint="pip install 'wrcd[monitor]'")
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise InputError(
            "needs a terminal to draw on", key="monitor", hint="over SSH ssh -t; for a pipe there is wrcd dump"
        )
    config = load_config(config_file)
    databases = [load_dbc(file) for file in dbc_files]
    rate = BIT_RATE if bit_rate is None else bit_rate
    note = ""
    if log is not None:
        model, warnings = model_of_log(log, config, databases, channel, rate)
        source: FrameSource = NoMore(log.name)
        note = "; ".join(warnings)
    else:
        # the bus opens while the screen's packages are imported
        source = open_source(config, *pick_bus(interface, channel, config_file, (config.interface, config.channel)))
        model = BusModel(config, databases, bit_rate=rate)
    try:
        from wrcd.monitor.screen import Monitor

        if isinstance(source, ReaderProcess):
            source.wait_open()
        app = Monitor(model, source, note=note)
        app.run()
    finally:
        source.close()
    return app.return_code or 0
