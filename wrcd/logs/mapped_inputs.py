"""Speed, torque and distance as the configuration maps them, in SI units, by columns."""

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import MessageReader, Receiver, message_key
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import EXTENDED, Frame
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config, Input
from wrcd.logs.scan import Frames, Scan, good_frames
from wrcd.logs.story_records import Series, newest_values

FloatArray = NDArray[np.float64]
MAX_HOLD_US = 1_000_000  # a speed that nothing has followed for so long is not known any more


class MappedInputs:
    """Reads the mapped inputs of a log. Values of frames that a receiver refuses for length, CRC, status or range are
    NaN; stuck values and jumps are shown as they are."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self.readers = Receiver(config.database, [i.source for i in config.inputs], config.data_ids).readers
        self.wrong: dict[int, int] = {}  # frames whose length or CRC does not fit, by Frame.key, of those under E2E

    def count_wrong(self, scan: Scan) -> None:
        """Look at every mapped message under E2E."""
        for key, reader in self.readers.items():
            if reader.data_id is not None:
                frames = scan.of(key)
                self.wrong[key] = len(frames) - len(good_frames(frames, reader.length, reader.data_id))

    def values(self, scan: Scan, one: Input) -> tuple[NDArray[np.int64], FloatArray]:
        """Stamps and values of a mapped signal, of the frames that carry it."""
        key, number = self._key(one.source.message), self._config.inputs.index(one)
        reader = self.readers[key]
        frames = good_frames(scan.of(key), reader.length, reader.data_id)
        if not len(frames):
            return frames.time_us, np.zeros(0)
        if reader.order is None or frames.data.shape[1] > 8:
            values, carried = self._one_by_one(frames, key, reader, number)
            return frames.time_us[carried], values[carried]
        return frames.time_us, reader.read_columns(frames.data)[0][reader.numbers.index(number)]

    def is_multiplexed(self, one: Input) -> bool:
        """Whether only some frames of its message carry it."""
        return self.readers[self._key(one.source.message)].is_multiplexed

    def _one_by_one(
        self, frames: Frames, key: int, reader: MessageReader, number: int
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Of a message that is not plain: multiplexed, both byte orders, floating-point. With the frames that carry the
        signal."""
        out, carried = np.full(len(frames), np.nan), np.ones(len(frames), bool)
        for row, (stamp_us, length) in enumerate(zip(frames.time_us.tolist(), frames.lengths.tolist(), strict=True)):
            data = frames.data[row, :length].tobytes()
            frame = Frame(stamp_us, key & ~EXTENDED, data, bool(key & EXTENDED), fd=reader.fd)
            reader.reset()  # its counter is another question
            found = reader.read(frame)
            if isinstance(found, Reason):
                carried[row] = number in reader.concerned(frame, found)
            else:
                value = next((s.value for s in found if s.source == number), None)
                carried[row], out[row] = value is not None, np.nan if value is None else value
        return out, carried

    def any_frame(self, scan: Scan, place: int) -> bool:
        """Whether the log has a frame that is of an axle (its place) and not of the vehicle as a whole. A message that
        carries other axles' values too is of it if a value of its own is ever another than zero."""
        of_axles = [i for i in self._config.inputs if i.source.quantity not in (Quantity.SPEED, Quantity.DIRECTION)]
        others = {i.source.message for i in of_axles if set(i.source.axles) - {place}}
        own = [i for i in of_axles if place in i.source.axles]
        if any(self._key(i.source.message) in scan.frames for i in own if i.source.message not in others):
            return True
        shared = [i for i in own if i.source.message in others]
        return any(bool((np.nan_to_num(self.values(scan, i)[1]) != 0).any()) for i in shared)

    def _key(self, name: str) -> int:
        return message_key(find_message(self._config.database, name))

    def _all(self, quantity: Quantity, place: int | None = None) -> list[Input]:
        return [
            i
            for i in self._config.inputs
            if i.source.quantity is quantity and (place is None or place in i.source.axles)
        ]

    def speed(self, scan: Scan) -> Series | None:
        """The vehicle's speed; None where neither a signal nor the configuration tells it."""
        mapped = self._all(Quantity.SPEED)
        if mapped:
            time_us, values = self.values(scan, mapped[0])
            return Series(time_us, {"speed_m_s": values}) if len(time_us) else None
        constant = self._config.constant_speed_m_s
        if constant is None:
            return None
        return Series(np.array([scan.begin_us, scan.end_us], np.int64), {"speed_m_s": np.full(2, constant)}, True)

    def torque(self, scan: Scan, place: int) -> Series | None:
        """The torque at an axle (its place), all signals that add up to it and the brakes' included."""
        parts = [
            (time_us, values, i.timeout_us)
            for i in (*self._all(Quantity.TORQUE, place), *self._all(Quantity.BRAKE_TORQUE, place))
            for time_us, values in [self.values(scan, i)]
        ]
        if not parts or not len(parts[0][0]):
            return None
        time_us, total, _ = parts[0]
        for other_us, values, timeout_us in parts[1:]:
            total = total + newest_values(other_us, values, time_us, timeout_us)
        return Series(time_us, {"torque_Nm": total})


def distance(speed: Series | None) -> Series | None:
    """Metres since the first speed. While the speed is not known, for MAX_HOLD_US the one before goes on; then the
    train stands still for this."""
    if speed is None:
        return None
    known = np.isfinite(speed.values["speed_m_s"])
    time_us, v = speed.time_us[known], np.abs(speed.values["speed_m_s"][known])
    if not len(time_us):
        return None
    steps_s = np.diff(time_us)
    if not speed.constant:
        steps_s = steps_s.clip(0, MAX_HOLD_US)
    metres = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps_s * 1e-6)))
    return Series(time_us, {"distance_m": metres}, speed.constant)
