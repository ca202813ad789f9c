"""What an axle carries, as TOML: its sensors, and what its axle box feels."""

from sim_ecu.physics.axlebox import AxleBox
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet
from sim_ecu.play import scenario_keys as keys
from sim_ecu.play.encoder import SAMPLE_US
from wrcd.settings import Section

NYQUIST_HZ = 0.5e6 / SAMPLE_US


def read_sensors(section: Section) -> SensorSet:
    """sensors: the name of a set, or a table of its kind and biases."""
    value = section.raw("sensors")
    if isinstance(value, str):
        return SENSOR_SETS[section.choice("sensors", SENSOR_SETS, "mems")]
    s = section.section("sensors")
    base = SENSOR_SETS[keys.KIND_OF_SENSORS.value(s)]
    out = base.biased(keys.YAW_BIAS.of(s), keys.LAT_BIAS.of(s), keys.TORQUE_BIAS.of(s))
    s.done()
    return out


def read_axlebox(section: Section, base: AxleBox) -> AxleBox:
    """[axlebox]: what differs from base."""
    out = AxleBox(
        vibration_m_s2=keys.VIBRATION.of(section, base.vibration_m_s2),
        band_hz=_band(section, base.band_hz),
        joint_m_s2=keys.JOINT.of(section, base.joint_m_s2),
        joint_every_m=keys.JOINT_EVERY.of(section, base.joint_every_m),
        joint_s=keys.JOINT_S.of(section, base.joint_s),
        joint_shape=section.choice(keys.JOINT_SHAPE.name, keys.JOINT_SHAPE.options, base.joint_shape),
        crossing_m_s2=keys.CROSSING.of(section, base.crossing_m_s2),
        crossing_at_m=keys.CROSSING_AT.of(section, base.crossing_at_m),
        gyro_per_m_s2=keys.GYRO_FEELS.of(section, base.gyro_per_m_s2),
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
