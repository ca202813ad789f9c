"""A consumer of Adhesion frames that keeps to docs/reference/what-a-controller-does.md, rule by rule.

    .venv/bin/python examples/careful_consumer.py -i socketcan -c vcan0

prints its decisions, as the pytest plug-in wrcd_contract reads them:

    {"axle": 1, "limit": null}
    {"axle": 1, "limit": 34.2}
"""

import argparse
from collections import deque
from functools import cache
from pathlib import Path
from typing import Any

from wrcd.bus.dbc import Database, Message, load_dbc
from wrcd.contract import Frame, Use, print_decisions

DBC = Path(__file__).parents[1] / "dbc" / "wrcd.dbc"
AXLES = (1, 2, 3, 4)
TIMEOUT_US = 60_000  # three cycles
SECOND_US = 1_000_000
MAX_DROPPED = 5  # in a second
MAX_LOST = 2  # frames between two that are used
RISE_US = 2_000_000  # a higher limit is believed when it has held so long
USABLE = {"Valid"}  # Degraded, NotAvailable and what is not known yet are not
UNKNOWN = "Unknown"
MAX_MU = 10_000  # 100 %; above are "error", "not available" and nonsense
MAX_AGE_MS = 60
HALF_WIDTHS = {
    "Within12pp": 12, "Within8pp": 8, "Within5pp": 5, "Within3pp": 3, "Within2pp": 2, "Within1pp": 1,
}  # fmt: skip


def crc(data_id: int, data: bytes) -> int:
    """E2E Profile 11: CRC-8 SAE J1850 from 0, over the data id, low byte first, and bytes 1 to the last."""
    c = 0
    for byte in (data_id & 0xFF, data_id >> 8, *data[1:]):
        c ^= byte
        for _ in range(8):
            c = (c << 1 ^ 0x1D if c & 0x80 else c << 1) & 0xFF
    return c


class Axle:
    """What one axle's frames allow."""

    def __init__(self, message: Message) -> None:
        self._message = message
        self._counter: int | None = None  # of the newest frame that was used
        self._other: int | None = None  # of a dropped frame: perhaps a new sequence begins
        self._good_us = 0  # when that frame came
        self._dropped: deque[int] = deque()  # when
        self._usable = False  # whether its word counts
        self._lower: deque[tuple[int, float]] = deque()  # lower ends of the last two seconds
        self._limit: float | None = None

    def hear(self, data: bytes, now_us: int) -> None:
        """A data frame under this axle's id."""
        whole = len(data) == self._message.length and data[0] == crc(self._message.frame_id, data)
        if whole and self._goes_on(data[1] & 0x0F, now_us):
            self._good_us = now_us
            self._read(data, now_us)
        else:
            self._dropped.append(now_us)

    def _goes_on(self, counter: int, now_us: int) -> bool:
        new = self._counter is None or now_us - self._good_us > TIMEOUT_US
        if not (new or _follows(self._counter, counter) or _follows(self._other, counter)):
            self._other = None if counter == self._counter else counter
            return False
        self._counter, self._other = counter, None
        return True

    def _read(self, data: bytes, now_us: int) -> None:
        raw: Any = self._message.decode(data, decode_choices=False, scaling=False)
        values: Any = self._message.decode(data)
        confidence = str(values["Confidence"])
        self._usable = (
            str(values["Validity"]) in USABLE
            and raw["MuAvailable"] <= MAX_MU
            and values["SampleAge"] <= MAX_AGE_MS
            and confidence != "None"
            and UNKNOWN not in (str(values["Surface"]), str(values["ContactState"]))
        )
        if self._usable and confidence in HALF_WIDTHS:  # Wider sets no limit and lifts none
            lower = max(raw["MuAvailable"] / 100 - HALF_WIDTHS[confidence], 0.0)
            self._lower.append((now_us, lower))
            while self._lower[0][0] < now_us - RISE_US:
                self._lower.popleft()
            self._limit = min(value for _, value in self._lower)

    def use(self, now_us: int) -> float | None:
        """The most to ask for now, in percent; None: fall back."""
        while self._dropped and self._dropped[0] < now_us - SECOND_US:
            self._dropped.popleft()
        silent = self._counter is None or now_us - self._good_us > TIMEOUT_US
        if silent or not self._usable or len(self._dropped) > MAX_DROPPED:
            return None
        return self._limit


def _follows(last: int | None, counter: int) -> bool:
    return last is not None and 1 <= (counter - last) % 15 <= 1 + MAX_LOST


@cache
def database() -> Database:
    """wrcd's messages, as cantools reads them."""
    return load_dbc(DBC)


class Careful:
    """All axles."""

    def __init__(self) -> None:
        messages = {a: database().get_message_by_name(f"Adhesion_A{a}") for a in AXLES}
        self._axles = {a: Axle(m) for a, m in messages.items()}
        self._by_id = {m.frame_id: self._axles[a] for a, m in messages.items()}

    def hear(self, frame: Frame) -> None:
        """Take a frame of the bus."""
        axle = self._by_id.get(frame.can_id)
        if axle is not None and frame.plain and not frame.extended:
            axle.hear(frame.data, frame.stamp_us)

    def use(self, axle: int, now_us: int) -> Use:
        """What is used of an axle now."""
        return Use(self._axles[axle].use(now_us), axle)


def main() -> None:
    """Read a bus until the process is ended."""
    p = argparse.ArgumentParser(description="print what a careful consumer makes of Adhesion frames")
    p.add_argument("-i", "--interface", default="socketcan")
    p.add_argument("-c", "--channel", default="vcan0")
    args = p.parse_args()
    print_decisions(Careful(), AXLES, args.interface, args.channel)


if __name__ == "__main__":
    main()
