"""`wrcd monitor`: from its arguments to the screen."""

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from wrcd.bus.dbc import load_dbc
from wrcd.bus.positions import is_fd
from wrcd.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.tools.bus_load import BIT_RATE
from wrcd.tools.bus_of import pick_bus
from wrcd.tools.monitor.model import Model
from wrcd.tools.monitor.of_log import model_of_log
from wrcd.tools.monitor.sources import NoMore, OwnLink, ReaderProcess, Source

IN_ONE_PROCESS = ("virtual",)  # python-can's interfaces that another process does not hear


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
        source: Source = NoMore(log.name)
        note = "; ".join(warnings)
    else:
        # the bus opens while the screen's packages are imported
        source = open_source(config, *pick_bus(interface, channel, config_file, (config.interface, config.channel)))
        model = Model(config, databases, bit_rate=rate)
    try:
        from wrcd.tools.monitor.screen.app import Monitor

        if isinstance(source, ReaderProcess):
            source.wait_open()
        app = Monitor(model, source, note=note)
        app.run()
    finally:
        source.close()
    return app.return_code or 0


def open_source(config: Config, interface: str, channel: str) -> Source:
    """The bus, read by a process of its own where that can hear it. Raises BusError; a process tells it later."""
    fd = interface == "socketcan" or any(is_fd(m) for m in config.database.messages)
    if interface in IN_ONE_PROCESS:
        from wrcd.bus.opening import open_link

        return OwnLink(open_link(interface, channel, None, fd=fd, user_settings=True))
    return ReaderProcess(interface, channel, fd)
