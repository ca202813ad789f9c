"""Frames that a daemon of some configuration sends and hears, made one by one."""

from collections.abc import Sequence

from wrcd.bus.dbc import data_id, find_message
from wrcd.bus.frame import Frame
from wrcd.bus.signals import Output
from wrcd.bus.writers import Value, Writer
from wrcd.core.configuration import Config

START_US = 1_700_000_000_000_000
GOOD: dict[str, Value] = {
    "Validity": "Valid", "MuAvailable": 30.0, "MuUsed": 10.0, "SampleAge": 5.0, "Surface": "Dry",
    "ContactState": "Adhering", "Confidence": "Within3pp",
}  # fmt: skip
DEGRADED: dict[str, Value] = {**GOOD, "Validity": "Degraded"}
NOTHING: dict[str, Value] = {
    "Validity": "NotAvailable", "MuAvailable": None, "MuUsed": None, "SampleAge": 255.0, "Surface": "Unknown",
    "ContactState": "Unknown", "Confidence": "None",
}  # fmt: skip
EXPLAINED: dict[str, Value] = {
    "WinningModel": 2.0, "DominantRule": 7.0, "Residual1": -12.0, "Residual2": -24.0, "Residual3": 3.0,
    "Residual4": -8.0, "Cause": "None", "StaleYawRate": 0.0, "StaleLatAccel": 0.0, "StaleTorque": 0.0,
    "StaleSpeed": 0.0,
}  # fmt: skip
REACHED: dict[str, Value] = {
    "Plausibility": "Consistent", "Outlier": 0.0, "Unchanged": 0.0,
    **{f"Reach{name}": 255.0 for name in ("YawRate", "LatAccel", "Torque", "Speed")},
    **{f"Refused{name}": "None" for name in ("YawRate", "LatAccel", "Torque", "Speed")},
}  # fmt: skip
RUNNING: dict[str, Value] = {
    "State": "Running", "Overruns": 0.0, "RejectedFrames": 0.0, "LastReason": "None",
    "ReceiveDrops": 0.0, "Reopens": 0.0,
}  # fmt: skip


class DaemonFrames:
    """Times are microseconds after START_US."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self._writers: dict[str, Writer] = {}

    def frame(self, output: Output | None, at_us: int, values: dict[str, Value]) -> Frame:
        """Of any message that is sent."""
        assert output is not None
        writer = self._writers.get(output.message)
        if writer is None:
            writer = Writer(find_message(self.config.database, output.message), output)
            self._writers[output.message] = writer
        return writer.frame(START_US + at_us, at_us // output.cycle_us, values)

    def adhesion(self, at_us: int, values: dict[str, Value], axle: int = 0) -> Frame:
        """Of an axle (its place)."""
        return self.frame(self.config.axles[axle].adhesion, at_us, values)

    def stretch(
        self, begin_us: int, end_us: int, values: dict[str, Value], cause: str = "None", axles: Sequence[int] = (0,)
    ) -> list[Frame]:
        """All that is sent about axles, at its cycles."""
        out = []
        for at_us in range(begin_us, end_us, 20_000):
            for axle in axles:
                of = self.config.axles[axle]
                out.append(self.adhesion(at_us, values, axle))
                if of.detail is not None and at_us % of.detail.cycle_us == 0:
                    out.append(self.frame(of.detail, at_us, {**EXPLAINED, "Cause": cause}))
                if of.inputs is not None and at_us % of.inputs.cycle_us == 0:
                    out.append(self.frame(of.inputs, at_us, REACHED))
            if self.config.status is not None and at_us % 1_000_000 == 0:
                checksum = float(int(self.config.design.checksum[:4], 16))
                out.append(self.frame(self.config.status, at_us, {**RUNNING, "DesignChecksum": checksum}))
        return out

    def sensor(self, message: str, at_us: int, **raw: float) -> Frame:
        """Of a mapped message, with raw values by the DBC's names."""
        found = find_message(self.config.database, message)
        identity = self.config.data_ids.get(message, data_id(found))
        output = Output(message, 5_000, identity)
        return Writer(found, output).raw_frame(START_US + at_us, at_us // 5_000, raw)
