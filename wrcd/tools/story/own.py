"""wrcd's own frames as the records of a story: what the controllers saw."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import message_key
from wrcd.bus.dbc import find_message
from wrcd.core.configuration import Config
from wrcd.core.vocabulary import CONFIDENCES
from wrcd.tools.said import Said, Values, said
from wrcd.tools.story.records import Adhesion, Detail, Health, Numbers, Places, Series
from wrcd.tools.story.scan import Frames, Scan, right_crc

INPUTS = ("YawRate", "LatAccel", "Torque", "Speed")
# half-widths in percentage points by the place of the word of Confidence: None and Wider have no bound
HALF_WIDTHS_PP = np.array([np.nan, *(w if np.isfinite(w) else np.nan for w, _ in CONFIDENCES)], dtype=np.float32)


class Own:
    """Decodes the messages that a daemon of a configuration sends. Frames that a receiver would refuse, for their
    length or their CRC, are left out and counted."""

    def __init__(self, config: Config) -> None:
        self._said: dict[tuple[str, int], Said] = {}
        self._data_ids: dict[int, int | None] = {}
        for s in said(config):
            assert s.kind is not None
            self._said[s.kind.name, s.kind.axle] = s
        outputs = [o for a in config.axles for o in (a.adhesion, a.detail, a.inputs, a.ahead)]
        for o in (*outputs, config.status, config.rejects, config.link):
            if o is not None:
                self._data_ids[_key(config, o.message)] = o.data_id
        self.wrong: dict[int, int] = {}  # refused frames by Frame.key, of messages under E2E

    @property
    def keys(self) -> frozenset[int]:
        """Of all of them."""
        return frozenset(s.key for s in self._said.values())

    def decoder(self, kind: str, axle: int = 0) -> Said | None:
        """The decoder of a message, if the configuration sends it."""
        return self._said.get((kind, axle))

    def cycle_us(self, kind: str, axle: int = 0) -> int:
        """How often it is sent; 0: it is not."""
        s = self._said.get((kind, axle))
        return 0 if s is None else s.cycle_us

    def good(self, scan: Scan, s: Said) -> Frames:
        """The frames of a message that a receiver takes."""
        frames, data_id = scan.of(s.key), self._data_ids.get(s.key)
        if data_id is None:
            return frames.only(frames.lengths == s.length)
        right = right_crc(frames, data_id, s.length)
        self.wrong[s.key] = int(len(right) - right.sum())
        return frames.only(right)

    def _read(self, scan: Scan, kind: str, axle: int) -> tuple[NDArray[np.int64], Mapping[str, Values]] | None:
        s = self.decoder(kind, axle)
        if s is None:
            return None
        frames = self.good(scan, s)
        return (frames.time_us, s.read(frames.data)) if len(frames) else None

    def adhesion(self, scan: Scan, axle: int) -> Adhesion | None:
        """Adhesion frames of an axle; None: there is none."""
        read = self._read(scan, "adhesion", axle)
        if read is None:
            return None
        time_us, v = read
        n = len(time_us)
        mu, confidence = _numbers(v, "MuAvailable", n), _places(v, "Confidence", n)
        half = HALF_WIDTHS_PP[confidence.clip(0)]
        return Adhesion(
            time_us, _places(v, "Validity", n), mu, _numbers(v, "MuUsed", n), (mu - half).clip(0), mu + half,
            confidence, _places(v, "ContactState", n), _places(v, "Surface", n), _numbers(v, "SampleAge", n),
        )  # fmt: skip

    def detail(self, scan: Scan, axle: int) -> Detail | None:
        """AdhesionDetail frames."""
        read = self._read(scan, "detail", axle)
        if read is None:
            return None
        time_us, v = read
        n = len(time_us)
        return Detail(
            time_us,
            np.stack([_numbers(v, f"Residual{m}", n) for m in range(1, 5)], axis=1),
            np.nan_to_num(_numbers(v, "WinningModel", n)).astype(np.int8),
            np.nan_to_num(_numbers(v, "DominantRule", n)).astype(np.int16),
            _places(v, "Cause", n),
            np.stack([_numbers(v, f"Stale{name}", n) > 0 for name in INPUTS], axis=1),
        )

    def health(self, scan: Scan, axle: int) -> Health | None:
        """InputHealth frames."""
        read = self._read(scan, "inputs", axle)
        if read is None:
            return None
        time_us, v = read
        n = len(time_us)
        return Health(
            time_us,
            np.stack([np.nan_to_num(_numbers(v, f"Reach{name}", n)).astype(np.uint8) for name in INPUTS], axis=1),
            np.stack([_places(v, f"Refused{name}", n) for name in INPUTS], axis=1),
            _places(v, "Plausibility", n),
            _numbers(v, "Outlier", n) > 0,
            _numbers(v, "Unchanged", n) > 0,
        )

    def series(self, scan: Scan, kind: str) -> Series | None:
        """A message of the daemon's own; words are their places."""
        read = self._read(scan, kind, 0)
        return None if read is None else Series(read[0], {name: c.astype(np.float64) for name, c in read[1].items()})


def _key(config: Config, message: str) -> int:
    return message_key(find_message(config.database, message))


def _numbers(values: Mapping[str, Values], name: str, n: int) -> Numbers:
    """A number's column, NaN where the message lacks the signal."""
    return values[name].astype(np.float32) if name in values else np.full(n, np.nan, np.float32)


def _places(values: Mapping[str, Values], name: str, n: int) -> Places:
    """A word's column, -1 where the message lacks the signal."""
    return values[name].astype(np.int8) if name in values else np.full(n, -1, np.int8)
