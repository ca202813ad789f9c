"""Frames of AdhesionAdvice as the daemon with the packaged DBC sends them."""

from functools import cache

from sim_ecu.play.encoder import Sent
from wrcd.bus.codec import Writer
from wrcd.bus.dbc import find_message
from wrcd.config.config import load_packaged


@cache
def _writer() -> Writer:
    config = load_packaged(1, advice=True)
    assert config.advice is not None
    output = config.advice.output
    return Writer(find_message(config.database, output.message), output)


def advice_frame(due_us: int, low_m_s2: float, middle_m_s2: float, validity: str = "Valid") -> Sent:
    """The frame of a slot: lower end and deceleration of the train (m/s²)."""
    writer = _writer()
    values: dict[str, float | str | None] = {
        "Validity": validity, "Deceleration": middle_m_s2, "DecelerationLow": low_m_s2, "Distance": 40.0,
        "Category": "Dry", "Age": 0.0, "Ahead": "None",
    }  # fmt: skip
    frame = writer.frame(due_us, due_us // writer.cycle_us, values)
    return Sent(due_us, frame.can_id, frame.data)
