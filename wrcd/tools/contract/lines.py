"""Makes a process of a Python object: it reads a bus, and prints its decisions as ProcessConsumer reads them."""

import json
import time
from collections.abc import Sequence

from wrcd.tools.contract.consumer import Hearing

TICK_S = 0.005  # how often the bus is looked at, and the object asked where no frame has come


def print_decisions(consumer: Hearing, axles: Sequence[int], interface: str, channel: str) -> None:
    """Hand every frame of a bus over and print a line for each new decision, until the process is ended.

    A frame's time is the bus's stamp. Raises BusError.
    """
    from wrcd.bus.opening import open_link  # the plug-in is loaded wherever pytest runs: it needs no bus then

    said: dict[int, float | None] = {}

    def decide(now_us: int) -> None:
        for axle in axles:
            limit = consumer.use(axle, now_us).limit_pct
            if axle not in said or said[axle] != limit:
                said[axle] = limit
                print(json.dumps({"axle": axle, "limit": limit}), flush=True)

    link = open_link(interface, channel, None, user_settings=True)
    try:
        while True:
            frames = link.receive(time.time_ns() // 1000)
            for frame in frames:
                if not frame.error:
                    consumer.hear(frame)
                    decide(frame.stamp_us)
            if not frames:
                decide(time.time_ns() // 1000)
                time.sleep(TICK_S)
    finally:
        link.close()
