"""What names, units and words of a train's DBC usually mean: English, German and a little French.

All that `wrcd init` proposes and `wrcd lint` calls an input comes from here. It is a guess by the look of things:
nothing that runs on the train reads this module.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from wrcd.bus.units import Quantity, factor
from wrcd.bus.words import unusable
from wrcd.tools.dbc.records import Message, Signal


@dataclass(frozen=True, slots=True)
class Look:
    """How the signals of a quantity look: parts of names, words of names, units that hardly another quantity has, words
    that speak against it."""

    parts: tuple[str, ...]
    words: frozenset[str]
    units: frozenset[str]
    contrary: frozenset[str]
    by_unit_alone: bool = True


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


BRAKES = ("brake", "brems", "frein")
# Names of what is asked for, supervised or counted, not measured.
NOT_MEASURED = _set(
    "soll set setpoint demand cmd command limit lim max min maximum minimum target ref reference request req requested "
    "desired status state valid validity quality error err fault fehler temp temperature age counter cnt crc checksum "
    "chk truth sim simtruth offset bias time timestamp stamp zeit year enable reach stale refused diag zustand guete "
    "variance noise vorgabe consigne ok accuracy"
)
LOOKS: dict[Quantity, Look] = {
    Quantity.YAW_RATE: Look(
        ("yaw", "gyro", "gier", "drehrate", "wendegeschw", "turnrate", "angularvel", "angularrate", "omegaz", "lacet"),
        _set("wz psi psip omega"), _set("rad/s deg/s mrad/s"),
        _set("x y roll pitch nick wank wheel motor rotor shaft steer steering str lenk wiper angle ang lean"),
    ),
    Quantity.LAT_ACCEL: Look(
        ("latacc", "lateral", "acclat", "accy", "accely", "yacc", "quer", "ybeschl", "transversal"),
        _set("ay acc accel acceleration beschl beschleunigung lat"), _set("g m/s2 mg"),
        _set("x z lon long longitudinal longit vert vertical laengs hoch vertikal"),
    ),
    Quantity.TORQUE: Look(
        ("torque", "effort", "moment", "zugkraft", "tractive", "traction", "trq", "mdreh", "couple", "antrieb"),
        _set("m t tq mom tqmot fz"), _set("nm knm"), _set("friction") | {*BRAKES},
    ),
    Quantity.SPEED: Look(
        ("speed", "velocity", "geschw", "vitesse"),
        _set("v vel spd vist vtrain"), _set("km/h m/s mph"),
        _set("wheel rad wind fan motor rotor shaft axle achse radsatz lateral"),
    ),
    Quantity.BRAKE_TORQUE: Look(
        ("braketorque", "brakeeffort", "bremsmoment", "brakemoment", "bremskraft", "brakeforce", "braketrq"),
        frozenset(), _set("nm knm"), frozenset(), by_unit_alone=False,
    ),
    Quantity.AXLE_LOAD: Look(
        ("load", "last", "gewicht", "weight", "charge"), frozenset(), _set("n kn kg t"),
        _set("dc motor cpu engine rel bus"), by_unit_alone=False,
    ),
    Quantity.DIRECTION: Look(
        ("direction", "richtung", "reverser", "fahrtri"), _set("dir sens"), frozenset(),
        _set("wind turn door tuer"), by_unit_alone=False,
    ),
    Quantity.WHEEL_RADIUS: Look(("radius", "rayon"), frozenset(), _set("m mm cm"), _set("curve track bogen"),
                                by_unit_alone=False),
}  # fmt: skip
FORCE_UNITS = ("n", "kn", "dan")  # of a tractive effort at the rim
MOTOR_WORDS = _set("motor mot engine asm fm fahrmotor tqmot")
TOTAL_WORDS = ("total", "gesamt", "sum", "overall")

AXLE_WORDS = _set("axle achse radsatz rs wheelset ws essieu axe a ax wg axis achs")
BOGIE_WORDS = _set("bogie bg dg drehgestell truck bogies fdg tdg")

ADHESION_PARTS = (
    "adhesion", "adherence", "friction", "reibwert", "kraftschluss", "haftwert", "haftreib", "muavail", "railcond",
)  # fmt: skip
ADHESION_WORDS = _set("mu grip")
USED_PARTS = ("used", "utili", "ausgen", "inuse", "genutzt")
PERCENT = ("%", "percent", "pct", "prozent")
TRUTH = ("truth", "groundtruth")

# What the four words of our Validity are called elsewhere, as letters, beside what wrcd.bus.words knows.
NOT_AVAILABLE = _set(
    "notavailable na none keine kein keiner nichtverfuegbar unavailable init invalid ungueltig sna nodata"
)
ERROR = _set("error err fehler fault stoerung failure fail defekt")
POOR = _set("poor schlecht estimated geschaetzt")
# Words that say that a sensor is at work: likely good, but a person has to say so.
LIKELY_GOOD = _set(
    "betrieb messbetrieb messung messen measuring measure operational operation operating running run on ein"
)
STATUS_PARTS = ("status", "state", "valid", "quality", "health", "zustand", "guete", "qualitaet")
CRC_WORDS = _set("crc chk checksum pruefsumme chksum cs prf")
COUNTER_WORDS = _set("counter cnt ctr alive sqc seq sequence bz zaehler botschaftszaehler rolling rc lebenszaehler mc")


def letters(text: str) -> str:
    """Letters and digits in lower case; umlauts as ae, oe, ue, ss."""
    text = text.lower()
    for umlaut, plain in (("ä", "ae"), ("ö", "oe"), ("ü", "ue"), ("ß", "ss"), ("é", "e"), ("è", "e")):
        text = text.replace(umlaut, plain)
    return "".join(c for c in text if c.isalnum())


def words(name: str) -> list[str]:
    """The words of a name, in lower case: GyroZ, AccY_A12, RS1_Sensorik -> gyro z, acc y a 12, rs 1 sensorik."""
    return [w.lower() for w in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


def contains(name: str, parts: Iterable[str]) -> bool:
    """Whether a name has one of these parts."""
    plain = letters(name)
    return any(part in plain for part in parts)


def converts(unit: str, quantity: Quantity) -> bool:
    """Whether a unit text can be converted to the quantity's; a missing one cannot."""
    try:
        factor(unit, quantity)
    except ValueError:
        return False
    return bool(unit.strip()) or quantity is Quantity.DIRECTION


def is_enumeration(s: Signal) -> bool:
    """Whether a signal's values are words: two at least that are no sentinels, and no unit."""
    told = {w for _, w in (s.words.pairs if s.words else ()) if not unusable(w)}
    return not s.unit.strip() and s.scale == 1 and s.offset == 0 and len(told) >= 2


def is_force(unit: str) -> bool:
    """Whether a unit is a force's."""
    return unit.strip().lower() in FORCE_UNITS


def is_truth(message: Message) -> bool:
    """Whether a message looks like ground truth, which only a rig has."""
    return contains(message.name, TRUTH) or any(contains(s.name, TRUTH) for s in message.signals)


def is_percent(s: Signal) -> bool:
    """Whether a signal is in percent."""
    return s.unit.strip().lower() in PERCENT


def is_fraction(s: Signal) -> bool:
    """Whether a signal is an adhesion of 0 … 1, by its range and its name."""
    shares = s.unit.strip() in ("", "1") and (s.low, s.high) == (0, 1) and 0 < s.scale < 1
    return shares and says_adhesion(s) and not contains(s.name, BRAKES)


def is_adhesion(message: Message) -> bool:
    """Whether a message looks like the one that tells adhesion: a percentage or a fraction, and a name that says so."""
    if is_truth(message):
        return False
    named = contains(message.name, ADHESION_PARTS) or bool(ADHESION_WORDS & set(words(message.name)))
    return any(is_fraction(s) or (is_percent(s) and (named or says_adhesion(s))) for s in message.signals)


def says_adhesion(s: Signal) -> bool:
    """Whether a signal's own name speaks of adhesion."""
    return contains(s.name, ADHESION_PARTS) or bool(ADHESION_WORDS & set(words(s.name)))


def is_status(s: Signal) -> bool:
    """Whether a signal tells how good others are."""
    return contains(s.name, STATUS_PARTS) and not s.unit.strip()


def is_crc(s: Signal) -> bool:
    """Whether a signal's name is a check sum's."""
    return bool(CRC_WORDS & set(words(s.name)))


def is_counter(s: Signal) -> bool:
    """Whether a signal's name is a message counter's."""
    return bool(COUNTER_WORDS & set(words(s.name)))
