"""A consumer of Adhesion frames as one writes it in ten minutes. The pytest plug-in wrcd_contract says what is wrong.

    .venv/bin/python examples/careless_consumer.py -i socketcan -c vcan0

Do not copy: no E2E, no time-out, every number is believed.
"""

import argparse

from wrcd.contract import Frame, Use, print_decisions

AXLES = (1, 2, 3, 4)


class Careless:
    """Takes each frame for what it seems to say."""

    def __init__(self) -> None:
        self._limits: dict[int, float | None] = {}

    def hear(self, frame: Frame) -> None:
        """Take a frame of the bus."""
        axle = frame.can_id - 0x090
        if axle in AXLES and len(frame.data) >= 4:
            validity = frame.data[1] >> 4
            percent = int.from_bytes(frame.data[2:4], "little") / 100
            self._limits[axle] = percent if validity else None

    def use(self, axle: int, now_us: int) -> Use:
        """What is used of an axle now."""
        return Use(self._limits.get(axle), axle)


def main() -> None:
    """Read a bus until the process is ended."""
    p = argparse.ArgumentParser(description="print what a careless consumer makes of Adhesion frames")
    p.add_argument("-i", "--interface", default="socketcan")
    p.add_argument("-c", "--channel", default="vcan0")
    args = p.parse_args()
    print_decisions(Careless(), AXLES, args.interface, args.channel)


if __name__ == "__main__":
    main()
