"""Every key of a scenario, by table: the parser reads by these, and docs/reference/scenario.md has them."""

from collections.abc import Mapping

import numpy as np

from sim_ecu.physics.axlebox import CORRUGATION_M_S, QUIET, SHAPES
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.rail import BLEND_M
from sim_ecu.physics.sensors import MOUNTINGS, SENSOR_SETS, G
from sim_ecu.physics.wheelset import Bogie, Wheelset
from sim_ecu.play.faults import ALL, DURATION_S, SIGNALS
from wrcd.config.keys import Choice, Flag, Interval, Key, Number, Text, Whole
from wrcd.config.section import Section
from wrcd.resources import DEFAULT_DESIGN

LARGEST = 1e6
Rows = tuple[tuple[float, ...], tuple[float, ...]]


class Measure(Number):
    """A number with its unit."""

    def __init__(
        self, name: str, what: str, low: float, high: float, default: float | None = None, *, unit: str = ""
    ) -> None:
        super().__init__(name, what, low, high, default)
        self.unit = unit

    def of(self, section: Section, default: float | None = None) -> float:
        """The number; its default may depend on what else is there."""
        given = self.read(section)
        if default is not None and self.name not in section:
            return default
        if given is None:
            raise section.newest_mistake
        return given


class Over(Key):
    """A number, or rows of time and number, between which it goes straight."""

    default: float | None

    def __init__(
        self, name: str, what: str, low: float, high: float, unit: str = "", default: float | None = None
    ) -> None:
        super().__init__(name, what)
        self.low, self.high, self.unit, self.default = low, high, unit, default

    def read(self, section: Section) -> Rows:
        """Times in s, and values. Raises InputError."""
        value = section.raw(self.name)
        if not isinstance(value, list):
            return (0.0,), (Number(self.name, "", self.low, self.high, self.default or 0.0).value(section),)
        try:
            table = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            table = np.zeros(0)
        if table.ndim != 2 or table.shape[1] != 2 or not len(table) or not np.all(np.diff(table[:, 0]) >= 0):
            section.refuse("takes a number or [[time_s, value], …] with times that do not fall", self.name)
            return (0.0,), (self.default or 0.0,)
        if not np.all((table[:, 1] >= self.low) & (table[:, 1] <= self.high)):
            section.refuse(f"takes values from {self.low:g} to {self.high:g}", self.name)
        return tuple(table[:, 0].tolist()), tuple(table[:, 1].tolist())


class Other(Key):
    """A key with a form of its own; the parser checks it."""

    def __init__(self, name: str, what: str, default: str = "–", unit: str = "") -> None:
        super().__init__(name, what)
        self.default, self.unit = default, unit


def _names(words: Mapping[str, object] | tuple[str, ...]) -> tuple[str, ...]:
    return tuple(words)


TITLE = Text("title", "one line for `sim-ecu list`; default: the file's name")
DURATION = Measure("duration_s", "how long it plays", 0.1, LARGEST, 30.0, unit="s")
AXLES = Other("axles", "the axles that run", "[1]")
SPEED = Over("speed_m_s", "the speed; without `hold_speed` only its first value counts", 0.0, 100.0, "m/s", 25.0)
HOLD_SPEED = Flag(
    "hold_speed",
    "true: the train keeps to `speed_m_s`, whatever the torques do; false: it starts with that speed and moves by its "
    "torques, its running resistance and its mass",
    True,
)
SEED = Other("seed", "of track, vibration and noise; of an axle: of a track of its own", "1")
TRACK = Other(
    "track",
    "irregularity: a spectrum (below), or the A_a of one of alignment alone",
    "good",
    "m rad",
)
SENSORS = Other("sensors", "a set, or a table", "mems")
RAIL = Other("rail", "sections of rail, each from a distance on", "needed")
DRIVE = Other("drive", "what driver and traction control want", "needed")
AXLEBOX = Other("axlebox", "what the axle box feels besides the track")
VEHICLE = Other(
    "vehicle",
    "a packaged vehicle, a .toml file with one, or a bogie and half a car body: what differs from the multiple unit's",
    DEFAULT_DESIGN,
)
SUSPENSION_TABLE = Other("suspension", "parts as data sheets give them, instead of constants of [vehicle]")
WHEELSET = Other("wheelset", "what differs from the vehicle's wheelset")
INTERVAL = Other("interval", "between what each of its constants lies with 90 %, as `sim-ecu calibrate` finds them")
FROM_LOGS = Other("origin", "what they were found from")
VEHICLE_TABLES: tuple[Key, ...] = (VEHICLE, SUSPENSION_TABLE, WHEELSET, INTERVAL, FROM_LOGS)  # what describes one
OF_AXLE = Other("axle", "[axle.N]: what differs for one axle")
FAULT = Other("fault", "what goes wrong, as with `sim-ecu play --fault`")
POSITION = Measure(
    "position_m", "ahead of the first axle; default: two vehicles of two bogies", -1000.0, 1000.0, unit="m"
)

NAME = Text("name", "what it is called", Wheelset().name)
_OF_WHEELSET = {
    "m_w": ("kg", "mass of the wheelset"),
    "I_w": ("kg m²", "its yaw inertia"),
    "r_0": ("m", "nominal wheel radius"),
    "L_g": ("m", "half gauge"),
    "gamma": ("", "conicity"),
    "k_w": ("N m/rad", "yaw stiffness to the ground; of a lone wheelset alone"),
    "M_v": (
        "kg",
        "mass that it carries, twice a wheel's load; in a bogie it follows from the masses: a given one is refused",
    ),
    "I_R": ("kg m²", "inertia of the driven (right) wheel with its drive"),
    "I_L": ("kg m²", "of the other wheel"),
    "k_s": ("N m/rad", "torsional stiffness of the shaft"),
    "C_s": ("N m s/rad", "its damping"),
    "a": ("m", "semi-axis of the contact ellipse along rolling"),
    "b": ("m", "the other one"),
    "G": ("Pa", "shear modulus"),
    "resistance_0": ("N", "running resistance at standstill"),
    "resistance_2": ("N s²/m²", "its part with the speed squared"),
}
PARAMETERS = tuple(
    Measure(name, _OF_WHEELSET[name][1], 1e-9, 1e15, value, unit=_OF_WHEELSET[name][0])
    for name, value in Wheelset().numbers().items()
)

_OF_VEHICLE = {
    "frame_mass_kg": ("kg", "mass of the bogie's frame"),
    "frame_yaw_inertia_kg_m2": ("kg m²", "its yaw inertia"),
    "semi_wheelbase_m": ("m", "half of the way from axle to axle"),
    "primary_lateral_N_m": ("N/m", "primary suspension of a wheelset, lateral stiffness"),
    "primary_lateral_damping_N_s_m": ("N s/m", "its damping"),
    "primary_yaw_N_m_rad": ("N m/rad", "its yaw stiffness"),
    "primary_yaw_damping_N_m_s_rad": ("N m s/rad", "its yaw damping"),
    "body_mass_kg": ("kg", "half of the car body"),
    "secondary_lateral_N_m": ("N/m", "secondary suspension of the bogie, lateral stiffness"),
    "secondary_lateral_damping_N_s_m": ("N s/m", "its damping"),
    "secondary_yaw_N_m_rad": ("N m/rad", "its yaw stiffness"),
    "secondary_yaw_damping_N_m_s_rad": ("N m s/rad", "its yaw damping, that of yaw dampers included"),
    "flange_clearance_m": ("m", "beyond this way from the middle of the track the flange pushes a wheelset back"),
    "flange_N_m": ("N/m", "its stiffness"),
}
VEHICLE_PARAMETERS = tuple(
    Measure(name, what, 0.0 if "damping" in name else 1e-9, 1e15, getattr(Bogie(), name), unit=unit)
    for name, (unit, what) in _OF_VEHICLE.items()
)

SUSPENSION = (
    Measure("axle_box_longitudinal_N_m", "stiffness of one axle box along the track", 1.0, 1e12, unit="N/m"),
    Measure("axle_box_lateral_N_m", "across it", 1.0, 1e12, unit="N/m"),
    Measure("axle_box_longitudinal_damping_N_s_m", "its damping along the track", 0.0, 1e12, unit="N s/m"),
    Measure("axle_box_lateral_damping_N_s_m", "across it", 0.0, 1e12, unit="N s/m"),
    Measure("bush_longitudinal_N_m", "of an axle box's bush beside its spring, along the track", 1.0, 1e12, unit="N/m"),
    Measure("bush_lateral_N_m", "across it", 1.0, 1e12, unit="N/m"),
    Measure("axle_box_spacing_m", "from the left axle box to the right one", 0.1, 5.0, unit="m"),
    Measure("secondary_spring_longitudinal_N_m", "stiffness of one of two along the track", 1.0, 1e12, unit="N/m"),
    Measure("secondary_spring_lateral_N_m", "across it", 1.0, 1e12, unit="N/m"),
    Measure("secondary_spring_spacing_m", "from the left spring to the right one", 0.1, 5.0, unit="m"),
    Measure("lateral_damper_N_s_m", "rate of one of the bogie's", 0.0, 1e12, unit="N s/m"),
    Whole("lateral_dampers", "dampers of the bogie", 1, 8, 2),
    Measure("yaw_damper_N_s_m", "rate of one of the bogie's", 0.0, 1e12, unit="N s/m"),
    Whole("yaw_dampers", "how many the bogie has", 1, 8, 2),
    Measure("yaw_damper_spacing_m", "from the left one to the right one", 0.1, 5.0, unit="m"),
)

# of a vehicle that was found from logs
INTERVALS = tuple(Interval(key.name, f"{key.what}, 90 %") for key in (*PARAMETERS, *VEHICLE_PARAMETERS))
ORIGIN: tuple[Key, ...] = (
    Text("date", "when it was found"),
    Other("logs", "names and digests of the logs"),
    Whole("stretches", "calm stretches of them that were used", 0, 10**9),
)

FROM = Measure("from_m", "where it begins", 0.0, 1e7, 0.0, unit="m")
CURVE = Choice("curve", "creep curve of the study; or give `mu_0`", _names(CURVES))
MU_0 = Measure("mu_0", "friction of a curve between them", 0.005, 1.0, 0.55)
LAW = tuple(
    Measure(name, f"{what}; default: as `mu_0` goes", 0.0, 10.0, unit=unit)
    for name, what, unit in (
        ("A", "friction at large slip over that at none", ""),
        ("B", "how fast it falls", "s/m"),
        ("k_A", "reduction in the area of adhesion", ""),
        ("k_S", "reduction in the area of slip", ""),
    )
)
RADIUS = Measure("radius_m", "curve radius, right-hand positive; 0: straight", -LARGEST, LARGEST, 0.0, unit="m")
CANT = Measure("cant_rad", "cant, the left rail higher positive", -0.2, 0.2, 0.0, unit="rad")
TRANSITION = Measure(
    "transition_m", "from the section before to this one; not in the first", BLEND_M, 1000.0, BLEND_M, unit="m"
)
EDGE = Measure("edge_m", "over which the creep curve changes: a film's edge", BLEND_M, 1000.0, BLEND_M, unit="m")

_EXACTLY_ONE = "; exactly one of the first four"
DEMANDS = (
    Over("torque_N_m", f"torque at the axle, braking negative{_EXACTLY_ONE}", -2e5, 2e5, "N m"),
    Over("utilisation", "share of the peak adhesion to use, braking negative", -3.0, 3.0),
    Over("creep", "creep to hold, braking negative", -1.0, 1.0),
    Over("creep_of_peak", "the same over the creep at the peak", -10.0, 10.0),
)
CREEP_LIMIT = Over(
    "creep_limit_of_peak", "creep at which traction control holds, over the creep at the peak", 0.05, 20.0, "", 1.0
)

KIND_OF_SENSORS = Choice("kind", "the set", _names(SENSOR_SETS), "mems")
YAW_BIAS = Measure("yaw_rate_bias_rad_s", "added to the gyro", -1.0, 1.0, 0.0, unit="rad/s")
LAT_BIAS = Measure("lateral_acceleration_bias_m_s2", "added to the accelerometer", -10.0, 10.0, 0.0, unit="m/s²")
TORQUE_BIAS = Measure("torque_bias_N_m", "added to the torque", -1e5, 1e5, 0.0, unit="N m")
SPEED_GAIN = Measure("speed_gain", "the speed is read times this: wheel wear", 0.9, 1.1, 1.0)
FRICTION_SHARE = Measure("friction_share", "of a braking torque that friction brakes make", 0.0, 1.0, 0.0)
FRICTION_GAIN = Measure("friction_gain", "how that part of the torque is read; 0: it is missing", 0.0, 2.0, 1.0)
MOUNTING = Choice("mounting", "where gyro and accelerometer are", MOUNTINGS, MOUNTINGS[0])
LATERAL_LEAD = Measure(
    "lateral_lead_s", "by how much the accelerometer is read before the gyro", 0.0, 0.008, 0.0, unit="s"
)
JITTER = Measure("jitter_s", "each of them is read up to so much earlier, at random", 0.0, 0.002, 0.0, unit="s")
G_SENSITIVITY = Measure(
    "g_sensitivity", "what the gyro reads of lateral acceleration", -0.01, 0.01, 0.0, unit="rad/s per m/s²"
)
MISALIGNMENT = Measure("misalignment_rad", "of the gyro's axis: roll rate leaks in", -0.2, 0.2, 0.0, unit="rad")
# of sets that sample inside
INNER_RATE = Whole(
    "inner_rate_hz", "of inner sampling, a multiple of 200; this and below default: the set's", 1000, 8000
)
CORNER = Measure("corner_hz", "of the low-pass before 200 Hz", 1.0, 3999.0, unit="Hz")
ORDER = Whole("filter_order", "of that low-pass, a Butterworth's", 1, 8)
RANGE = Measure("range_m_s2", "the accelerometer clips inside at ± this", 1.0, 200 * G, unit="m/s²")
RECTIFIED = Measure("rectification", "offset per square of vibration", -0.1, 0.1, unit="m/s² per (m/s²)²")
GYRO_RECTIFIED = Measure("gyro_rectification", "the same of the gyro", -0.01, 0.01, unit="rad/s per (m/s²)²")
INNER: tuple[Key, ...] = (INNER_RATE, CORNER, ORDER, RANGE, RECTIFIED, GYRO_RECTIFIED)

VIBRATION = Measure(
    "vibration_m_s2", "rms at the accelerometer, of what its sampling reaches", 0.0, 200.0, QUIET.vibration_m_s2,
    unit="m/s²",
)  # fmt: skip
BAND = Other("band_hz", "of the vibration; above 100 Hz with inner sampling alone", "[20, 100]", "Hz")
BAND_POWER = Measure(
    "vibration_power", "its density goes with frequency to this power", 0.0, 4.0, QUIET.vibration_power
)
JOINT = Measure("joint_m_s2", "peak of the pulse at a rail joint", 0.0, 1000.0, QUIET.joint_m_s2, unit="m/s²")
JOINT_EVERY = Measure("joint_every_m", "from joint to joint", 0.5, LARGEST, QUIET.joint_every_m, unit="m")
JOINT_S = Measure("joint_s", "how long a pulse lasts", 1e-3, 0.5, QUIET.joint_s, unit="s")
JOINT_SHAPE = Choice("joint_shape", "bipolar: one sine period; unipolar: half of one", SHAPES, QUIET.joint_shape)
CROSSING = Measure("crossing_m_s2", "peak of a crossing's pulses", 0.0, 1000.0, QUIET.crossing_m_s2, unit="m/s²")
CROSSING_AT = Measure("crossing_at_m", "where the crossing is", 0.0, 1e7, QUIET.crossing_at_m, unit="m")
CORRUGATION = Measure(
    "corrugation_m_s2", f"amplitude on corrugated rail at {CORRUGATION_M_S:g} m/s; it goes with the speed's square",
    0.0, 1000.0, QUIET.corrugation_m_s2, unit="m/s²",
)  # fmt: skip
WAVELENGTH = Measure(
    "corrugation_wavelength_m", "of the corrugation", 0.01, 1.0, QUIET.corrugation_wavelength_m, unit="m"
)
CORRUGATED = Interval("corrugation_m", "from where to where it lies, in m; default: everywhere")
FLAT = Measure("flat_m_s2", "peak of a wheel flat's blow, once a turn", 0.0, 2000.0, QUIET.flat_m_s2, unit="m/s²")
FLAT_EVERY = Measure("flat_every_m", "a turn of the wheel", 0.5, 10.0, QUIET.flat_every_m, unit="m")
GYRO_FEELS = Measure(
    "gyro_per_m_s2", "what the gyro feels of it", -1.0, 1.0, QUIET.gyro_per_m_s2, unit="rad/s per m/s²"
)

KIND = Other("kind", "see `sim-ecu list`", "needed")
AT = Measure("at_s", "when it begins; needed", 0.0, LARGEST, unit="s")
FOR = Measure("duration_s", "how long it lasts", 0.001, LARGEST, DURATION_S, unit="s")
OF = Choice("of", "which signal; all: the axle's own three", (*SIGNALS, ALL), "yaw_rate")
AXLE = Other("axle", "of which axle", "the first")
AMOUNT = Other("amount", "how much", "the kind's", "the kind's")

SHARED: tuple[Key, ...] = (RAIL, DRIVE, TRACK, SENSORS, AXLEBOX, SEED)  # that an axle may have otherwise
# By the table's name.
TABLES: Mapping[str, tuple[Key, ...]] = {
    "": (TITLE, DURATION, AXLES, SPEED, HOLD_SPEED, *SHARED, *VEHICLE_TABLES, OF_AXLE, FAULT),
    "vehicle": VEHICLE_PARAMETERS,
    "suspension": SUSPENSION,
    "wheelset": (NAME, *PARAMETERS),
    "rail": (FROM, CURVE, MU_0, *LAW, RADIUS, CANT, TRANSITION, EDGE),
    "drive": (*DEMANDS, CREEP_LIMIT),
    "sensors": (
        KIND_OF_SENSORS, YAW_BIAS, LAT_BIAS, TORQUE_BIAS, SPEED_GAIN, FRICTION_SHARE, FRICTION_GAIN, MOUNTING,
        LATERAL_LEAD, JITTER, G_SENSITIVITY, MISALIGNMENT, *INNER,
    ),
    "axlebox": (
        VIBRATION, BAND, BAND_POWER, JOINT, JOINT_EVERY, JOINT_S, JOINT_SHAPE, CROSSING, CROSSING_AT, CORRUGATION,
        WAVELENGTH, CORRUGATED, FLAT, FLAT_EVERY, GYRO_FEELS,
    ),
    "axle.N": (*SHARED, POSITION),
    "fault": (KIND, AT, FOR, OF, AXLE, AMOUNT),
}  # fmt: skip
