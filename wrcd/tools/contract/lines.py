"""Makes a process of a Python object: it reads a bus, and prints its decisions as ProcessConsumer reads them."""

import json
import time
from collections.abc import Sequence

from wrcd.bus.pythoncan import from_message, open_bus
from wrcd.tools.contract.consumer import Hearing

TICK_S = 0.01  # how often the object is asked where no frame comes


def print_decisions(consumer: Hearing, axles: Sequence[int], interface: str, channel: str) -> None:
    """Hand every frame of a bus over and print a line for each new decision, until the process is ended.

    A frame's time is the bus's stamp, where that is near the clock. Raises BusError.
    """
    said: dict[int, float | None] = {}
    bus = open_bus(interface, channel, user_settings=True)
    try:
        while True:
            message = bus.recv(TICK_S)
            now_us = time.time_ns() // 1000
            if message is not None and not message.is_error_frame:
                stamp_us = round(message.timestamp * 1e6)
                now_us = stamp_us if abs(stamp_us - now_us) < 10_000_000 else now_us
                consumer.hear(from_message(message, now_us))
            for axle in axles:
                limit = consumer.use(axle, now_us).limit_pct
                if axle not in said or said[axle] != limit:
                    said[axle] = limit
                    print(json.dumps({"axle": axle, "limit": limit}), flush=True)
    finally:
        bus.shutdown()
