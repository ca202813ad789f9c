"""A driver on the bus: `sim-ecu driver` moves the lever of a rig that somebody else drives, and the rig's end of it."""

from sim_ecu.loop.control.braking_rate import RATES
from sim_ecu.loop.control.control_on_bus import Watch
from sim_ecu.loop.driver import LEVER_US, MarkDriver
from sim_ecu.loop.rig_messages import AGAIN, CAME, NONE_YET, SILENT, NewestFrame, SilenceRecord, rig_message
from sim_ecu.play.encoder import Channel, Sent, databases

CAUTIOUS = f"brakes with {RATES.cautious:g} m/s²"
WORDS = {
    SILENT: f"driver's lever silent: {CAUTIOUS}", NONE_YET: "no driver yet: coasts", CAME: "driver's lever comes",
    AGAIN: "driver's lever comes again",
}  # fmt: skip


class LeverOnBus:
    """The rig's end: passes on what a driver on the bus demands. Where that falls silent the train
    brakes at the cautious rate. full_m_s2: deceleration of full service."""

    def __init__(self, full_m_s2: float) -> None:
        self._lever = NewestFrame(rig_message("DriverLever"))
        self._full_m_s2 = full_m_s2
        self.silence = SilenceRecord(LEVER_US)
        self.ids: tuple[int, ...] = (self._lever.message.frame_id,)
        self.news: str | None = None  # of the last look

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take the lever."""
        if can_id in self.ids:
            self._lever.take(data, stamp_us)

    def demand(self, now_us: int, position_m: float, speed_m_s: float, mark_m: float | None) -> float:
        """Return the share that the driver demands."""
        silent = not self._lever.fresh(now_us)
        news = self.silence.look(now_us, silent) if now_us >= self._lever.timeout_us else None
        self.news = None if news is None else WORDS[news]
        if self._lever.stamp_us is None:
            return 0.0
        return -RATES.cautious / self._full_m_s2 if silent else float(self._lever.values["Share"])


class DriverOnBus(Watch):
    """The driver's end, in the place of a controller: hears where the train is and what the driver listens to, and
    sends the lever. Without the train's position and speed it brakes at the cautious rate."""

    def __init__(self, driver: MarkDriver, full_m_s2: float) -> None:
        self._driver, self._full_m_s2 = driver, full_m_s2
        self._train = NewestFrame(rig_message("TrainPosition"))
        self._speed = NewestFrame(databases()[0].get_message_by_name("VehicleSpeed"))
        self._heard = {m.message.frame_id: m for m in (self._train, self._speed)}
        self._lever = Channel(rig_message("DriverLever"))
        self.ids = (*self._heard, *driver.ids)
        self.paced_by = self._train.message.frame_id
        self._told: str = ""

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        if can_id in self._heard:
            self._heard[can_id].take(data, stamp_us)
        self._driver.hear(can_id, data, stamp_us)

    def tick(self, now_us: int) -> list[Sent]:
        """The lever, where it is due; none before the train is known."""
        if now_us % LEVER_US or self._train.stamp_us is None or self._speed.stamp_us is None:
            return []
        return [self._lever.encode(now_us, {"Share": self._share(now_us)})]

    def _share(self, now_us: int) -> float:
        if not all(m.fresh(now_us) for m in self._heard.values()):
            return -RATES.cautious / self._full_m_s2
        position, to_mark = (float(self._train.values[name]) for name in ("Position", "ToMark"))
        return self._driver.demand(now_us, position, float(self._speed.values["Speed"]), position + to_mark)

    def look(self, now_us: int) -> list[str]:
        """Return what the driver has decided, and that the train is silent."""
        d = self._driver
        if self._train.stamp_us is None:
            told = ""
        elif not all(m.fresh(now_us) for m in self._heard.values()):
            told = f"train silent: {CAUTIOUS}"
        elif d.begun_us is not None:
            told = f"brakes for the mark, planned with {d.rate_m_s2:.2f} m/s²"
        elif d.tested_us is not None:
            told = "brake test"
        else:
            told = "coasts"
        if told == self._told:
            return []
        self._told = told
        return [told] if told else []

    def summary(self) -> list[str]:
        """Return what came of it."""
        d = self._driver
        if d.begun_us is None:
            return ["brake     never decided on"]
        test = "after a test" if d.tested_us is not None else "without a test"
        return [f"brake     planned with {d.rate_m_s2:.2f} m/s², {test}"]
