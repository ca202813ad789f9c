"""Which signals of a train's DBC look like an input or an adhesion, by what names, units and words usually mean in
English, German and a little French.

All that `wrcd init` proposes and `wrcd lint` calls an input comes from here. It is a guess by the look of things:
nothing that runs on the train reads this module.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from wrcd.bus.units import Quantity, factor, plain_unit
from wrcd.bus.words import tells_status, unusable
from wrcd.dbc.dbc_lines import NO_NODE, DbcText, Message, Signal


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
CRC_WORDS = _set("crc chk checksum pruefsumme chksum cs prf")
COUNTER_WORDS = _set("counter cnt ctr alive sqc seq sequence bz zaehler botschaftszaehler rolling rc lebenszaehler mc")

MIN_SCORE = 3  # of a candidate; a name that says it, or a unit that only this quantity has
SURE_SCORE = 6  # both
MIN_BITS, MAX_BITS = 6, 64  # of a measurement
NAME, WEAK_NAME, AXIS, MESSAGE_NAME, UNIT, CONTRARY = 4, 2, 1, 2, 3, -6


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
    labels = {w for w in s.labels if not unusable(w)}
    return not s.unit.strip() and s.scale == 1 and s.offset == 0 and len(labels) >= 2


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
    return tells_status(s.name, s.unit, s.labels)


def is_crc(s: Signal) -> bool:
    """Whether a signal's name is a check sum's."""
    return bool(CRC_WORDS & set(words(s.name)))


def is_counter(s: Signal) -> bool:
    """Whether a signal's name is a message counter's."""
    return bool(COUNTER_WORDS & set(words(s.name)))


def score(message: Message, s: Signal, quantity: Quantity) -> int:
    """How much a signal looks like a quantity; below MIN_SCORE not at all."""
    look = LOOKS[quantity]
    own, around = words(s.name), words(message.name)
    unit = s.unit.strip()
    rim = is_force(unit) and quantity in (Quantity.TORQUE, Quantity.BRAKE_TORQUE)
    if unit and not rim and not converts(unit, quantity):
        return 0
    named = NAME if contains(s.name, look.parts) else WEAK_NAME if look.words & set(own) else 0
    inside = MESSAGE_NAME if contains(message.name, look.parts) else 0
    if quantity is Quantity.BRAKE_TORQUE and unit and not named and contains(s.name + message.name, BRAKES):
        named = NAME if contains(s.name, BRAKES) or score(message, s, Quantity.TORQUE) > 0 else 0
    if quantity is Quantity.DIRECTION and _tells_direction(s):
        named += UNIT
    telling = UNIT if plain_unit(unit) in look.units else 0
    if telling and not look.by_unit_alone and not named and not inside:
        return 0
    axis = (
        AXIS if (quantity is Quantity.YAW_RATE and "z" in own) or (quantity is Quantity.LAT_ACCEL and "y" in own) else 0
    )
    total = named + inside + telling + axis
    brakes = quantity is Quantity.TORQUE and contains(s.name, BRAKES)
    if (NOT_MEASURED | look.contrary) & set(own) or brakes or contains(s.name, TRUTH):
        total += CONTRARY
    if NOT_MEASURED & set(around):
        total += CONTRARY // 2
    return total if named or inside or telling else 0


def _tells_direction(s: Signal) -> bool:
    labels = [letters(w) for w in s.labels]
    return any(w.startswith(("rev", "back", "rueck")) for w in labels) and any(
        w.startswith(("for", "vor")) for w in labels
    )


@dataclass(frozen=True, slots=True)
class SignalCandidate:
    """A signal that may carry a quantity. axle: the number that its names tell, or None; bogie likewise."""

    message: Message
    signal: Signal
    quantity: Quantity
    score: int
    axle: int | None
    bogie: int | None

    @property
    def name(self) -> str:
        """As a configuration names it."""
        return self.signal.path


def candidates(dbc: DbcText) -> Iterator[SignalCandidate]:
    """Every signal that may be an input, once for each quantity that it looks like most; the best first."""
    ours = senders_of_adhesion(dbc)
    found: list[SignalCandidate] = []
    for m in dbc.on_the_bus:
        if m.sender in ours or is_adhesion(m) or is_truth(m):
            continue
        for s in m.signals:
            words_only = is_enumeration(s) or not MIN_BITS <= s.length <= MAX_BITS
            scores = {q: score(m, s, q) for q in LOOKS if q is Quantity.DIRECTION or not words_only}
            best = max(scores.values())
            if best >= MIN_SCORE:
                quantity = next(q for q, n in scores.items() if n == best)
                found.append(SignalCandidate(m, s, quantity, best, *numbers(m.name, s.name)))
    yield from sorted(found, key=lambda c: -c.score)


def senders_of_adhesion(dbc: DbcText) -> set[str]:
    """Nodes that send adhesion and nothing that is surely an input: what stands in the DBC for this daemon."""
    ours = {m.sender for m in dbc.messages if is_adhesion(m)} - {NO_NODE}
    others = {
        m.sender
        for m in dbc.messages
        if m.sender in ours and not is_adhesion(m)
        for s in m.signals
        if max(score(m, s, q) for q in (Quantity.YAW_RATE, Quantity.LAT_ACCEL)) >= SURE_SCORE
    }
    return ours - others


def numbers(message: str, signal: str) -> tuple[int | None, int | None]:
    """Axle and bogie that two names tell, as far as they do. A number without a word for it counts as an axle's."""
    own, around = words(signal), words(message)
    bogie = _after(BOGIE_WORDS, own) or _after(BOGIE_WORDS, around)
    axle = _after(AXLE_WORDS, own) or _after(AXLE_WORDS, around)
    if axle is None:
        axle = _free(own) or _free(around)
    return axle, bogie


def _after(before: frozenset[str], name: list[str]) -> int | None:
    return next((int(b) for a, b in pairwise(name) if a in before and b.isdigit()), None)


def _free(name: list[str]) -> int | None:
    """A number that no word for a bogie stands before."""
    places = (i for i, w in enumerate(name) if w.isdigit() and (not i or name[i - 1] not in BOGIE_WORDS))
    return next((int(name[i]) for i in places), None)
