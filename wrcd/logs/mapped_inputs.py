"""Speed, torque and distance as the configuration maps them, in SI units, by columns."""

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.dbc import find_message
from wrcd.bus.positions import message_key
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config, Input
from wrcd.core.reading import Receiver
from wrcd.logs.columns import batch_of
from wrcd.logs.scan import Scan, good_frames
from wrcd.logs.story_records import Series, newest_values

FloatArray = NDArray[np.float64]
MAX_HOLD_US = 1_000_000  # a speed that nothing has followed for so long is not known any more


class MappedInputs:
    """Reads the mapped inputs of a log. Values of frames that a receiver refuses for length, CRC, status or range are
    NaN; stuck values and jumps are shown as they are."""

    def __init__(self, config: Config) -> None:
        self._config = config
        # the counter is another question
        sources = [i.source for i in config.inputs]
        self._receiver = Receiver(config.database, sources, config.data_ids, follows=False)
        self.named = self._receiver.mapped.named
        self.messages = {m.key: m for m in self._receiver.mapped.messages}
        self.wrong: dict[int, int] = {}  # frames whose length or CRC does not fit, by Frame.key, of those under E2E

    def count_wrong(self, scan: Scan) -> None:
        """Look at every mapped message under E2E."""
        for key, m in self.messages.items():
            if m.data_id is not None:
                frames = scan.of(key)
                self.wrong[key] = len(frames) - len(good_frames(frames, m.length, m.data_id))

    def values(self, scan: Scan, one: Input) -> tuple[NDArray[np.int64], FloatArray]:
        """Stamps and values of a mapped signal, of the frames that carry it."""
        key, number = self._key(one.source.message), self._config.inputs.index(one)
        m = self.messages[key]
        frames = good_frames(scan.of(key), m.length, m.data_id)
        if not len(frames):
            return frames.time_us, np.zeros(0)
        _, samples = self._receiver.read_all(
            batch_of(frames.time_us, np.full(len(frames), key), frames.lengths, frames.data, m.fd)
        )
        samples = samples[samples["input"] == number]
        return frames.time_us[samples["frame"]], samples["value"]

    def is_multiplexed(self, one: Input) -> bool:
        """Whether only some frames of its message carry it."""
        return self.messages[self._key(one.source.message)].is_multiplexed

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
