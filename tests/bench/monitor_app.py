"""`wrcd monitor` as on SocketCAN, with one end of a socket pair in the place of the raw CAN socket.

Run as a module on a terminal, with the pair's end as the file descriptor that the environment's MONITOR_END tells; the
argument that a reader gets runs that. At its end it writes, as JSON, to the file that MONITOR_BENCH names what it saw.
"""

import json
import os
import sys
import time
from pathlib import Path

from tests.bench.on_pair import CHANNEL, resident_kb, use_pair

END = int(os.environ.get("MONITOR_END", "3"))  # of the pair, as a file descriptor
MODULE = "tests.bench.monitor_app"


def read() -> int:
    """The reader's process."""
    use_pair(END)
    from wrcd.monitor import bus_reader

    return bus_reader.main()


def show() -> int:
    """The screen, and at its end what it has seen."""
    from wrcd.bus.dbc import load_dbc
    from wrcd.config.config import load_config
    from wrcd.monitor.bus_model import BusModel
    from wrcd.monitor.screen import Monitor
    from wrcd.monitor.sources import ReaderProcess

    class Timed(Monitor):
        """Notes when the screen was updated."""

        times: list[float] = []

        def redraw(self) -> None:
            before = self.updates
            super().redraw()
            if self.updates > before:
                self.times.append(time.monotonic())

    source = ReaderProcess("socketcan", CHANNEL, True, MODULE, (END,))
    source.wait_open()
    model = BusModel(load_config(None), [load_dbc(Path("dbc/sim_ecu.dbc"))])
    app = Timed(model, source)
    app.run()
    seen = {
        "frames": model.load.frames, "lost": source.state().lost, "updates": app.times,
        "resident_kb": resident_kb()["VmHWM"],
    }  # fmt: skip
    Path(os.environ["MONITOR_BENCH"]).write_text(json.dumps(seen))
    return 0


if __name__ == "__main__":
    for library in ("OPENBLAS", "OMP", "MKL"):  # as the command does
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    sys.exit(show() if len(sys.argv) == 1 else read())
