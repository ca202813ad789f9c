"""What an axle carries, as TOML: its sensors, and what its axle box feels."""

from sim_ecu.physics.axlebox import SHAPES, AxleBox
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet
from sim_ecu.play.encoder import SAMPLE_US
from wrcd.settings import Section

NYQUIST_HZ = 0.5e6 / SAMPLE_US


def read_sensors(section: Section) -> SensorSet:
    """sensors: the name of a set, or a table of its kind and biases."""
    value = section.raw("sensors")
    if isinstance(value, str):
        return SENSOR_SETS[section.choice("sensors", SENSOR_SETS, "mems")]
    s = section.section("sensors")
    base = SENSOR_SETS[s.choice("kind", SENSOR_SETS, "mems")]
    out = base.biased(
        s.number("yaw_rate_bias_rad_s", 0.0, -1.0, 1.0),
        s.number("lateral_acceleration_bias_m_s2", 0.0, -10.0, 10.0),
        s.number("torque_bias_N_m", 0.0, -1e5, 1e5),
    )
    s.done()
    return out


def read_axlebox(section: Section, base: AxleBox) -> AxleBox:
    """[axlebox]: what differs from base."""
    out = AxleBox(
        vibration_m_s2=section.number("vibration_m_s2", base.vibration_m_s2, 0.0, 100.0),
        band_hz=_band(section, base.band_hz),
        joint_m_s2=section.number("joint_m_s2", base.joint_m_s2, 0.0, 1000.0),
        joint_every_m=section.number("joint_every_m", base.joint_every_m, 0.5, 1e6),
        joint_s=section.number("joint_s", base.joint_s, 1e-3, 0.5),
        joint_shape=section.choice("joint_shape", SHAPES, base.joint_shape),
        crossing_m_s2=section.number("crossing_m_s2", base.crossing_m_s2, 0.0, 1000.0),
        crossing_at_m=section.number("crossing_at_m", base.crossing_at_m, 0.0, 1e7),
        gyro_per_m_s2=section.number("gyro_per_m_s2", base.gyro_per_m_s2, -1.0, 1.0),
    )
    section.done()
    return out


def _band(section: Section, default: tuple[float, float]) -> tuple[float, float]:
    value = section.raw("band_hz")
    if value is None:
        return default
    if not isinstance(value, list) or len(value) != 2 or not all(type(f) in (int, float) for f in value):
        raise section.error(f"takes [lowest, highest], not {value!r}", "band_hz", "e.g. [20, 100]")
    low, high = float(value[0]), float(value[1])
    # not narrower than a piece of vibration resolves
    if not 0 <= low <= min(high, NYQUIST_HZ) - 0.1:
        raise section.error(
            f"takes a band that rises by 0.1 Hz at least, from 0 or more to {NYQUIST_HZ:g} Hz, not {value!r}",
            "band_hz",
            "what lies above the sampling's own limit is left out",
        )
    return low, high
