"""Listen to wrcd's Adhesion frames as a controller would: E2E, time-out, Validity.

    .venv/bin/sim-ecu play leaf-patch -c vcan0 &
    .venv/bin/wrcd run -i socketcan -c vcan0 &
    .venv/bin/python examples/subscribe.py -i socketcan -c vcan0

prints, from a second after the start on:

    axle 1: NotAvailable
    axle 1: adhesion 38.1 % (Within5pp), 25.8 % in use
    axle 1: adhesion 37.9 % (Within5pp), 25.8 % in use
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import cantools
from cantools.database.can import Database

from wrcd.core.reading import Checker

DBC = Path(__file__).parents[1] / "dbc" / "wrcd.dbc"
TIMEOUT_S = 0.06  # three cycles: an estimate that is older is none


def listen(bus: can.BusABC, database: Database) -> Iterator[str]:
    """Yield a line for each Adhesion frame of axle 1, or for its absence; end when the bus is silent for a second."""
    message = database.get_message_by_name("Adhesion_A1")
    checker = Checker(data_id=message.frame_id)
    silent_s = 0.0
    while silent_s < 1.0:
        received = bus.recv(TIMEOUT_S)
        if received is None:
            silent_s += TIMEOUT_S
            yield "axle 1: no frame within its time-out"
            continue
        if received.arbitration_id != message.frame_id or received.is_extended_id or received.is_error_frame:
            continue
        silent_s = 0.0
        data = bytes(received.data)
        if reason := checker.check(data):
            yield f"axle 1: rejected, {reason}"
            continue
        values: Any = message.decode(data)
        if str(values["Validity"]) != "Valid":
            yield f"axle 1: {values['Validity']}"  # do not use the rest
            continue
        available, used, level = values["MuAvailable"], values["MuUsed"], values["Confidence"]
        yield f"axle 1: adhesion {available:.1f} % ({level}), {used:.1f} % in use"


def main() -> None:
    """Print until the bus is silent for a second."""
    p = argparse.ArgumentParser(description="print the Adhesion frames of axle 1")
    p.add_argument("-i", "--interface", default="socketcan")
    p.add_argument("-c", "--channel", default="vcan0")
    args = p.parse_args()
    database = cantools.database.load_file(DBC)
    assert isinstance(database, Database)
    with can.Bus(channel=args.channel, interface=args.interface) as bus:
        for line in listen(bus, database):
            print(line, flush=True)


if __name__ == "__main__":
    main()
