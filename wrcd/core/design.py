"""The design file: everything that the estimator knows, made by `sim-ecu design`, reviewed, shipped and loaded."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd.checksum import checksum
from wrcd.core.terms import CERTAIN, CHANNELS, COLUMNS, INPUTS, MODELS, PAIR_FEATURES, SPAN_TICKS, PairState, Regime
from wrcd.errors import InputError, NotThere
from wrcd.native import constant

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BoolArray = NDArray[np.bool_]

FORMAT, BEFORE = "wrcd-design/5", "wrcd-design/4"
FEATURES_BEFORE = 170  # that pairs are judged by in a design of before: the first ones
COLUMNS_BEFORE = 27  # that rules of the format before are given: the first ones; by the others nothing moves
NEXT_WHEELSET_M = 2.5  # where the design names no bogie
HALF_WHEELBASES_M = 0.1, 10.0  # least and most
STATES = 5  # psi, y', psi', y_t, y - y_t; then those of a bogie's frame, where the design holds the wheelset in one
FORMS = ("wrcd", "paper")
MIN_WINDOW_S = 0.25  # the torque of the moment, and that before a step, lie within it
MAX_WORLDS, MAX_SENTENCE = 40, 200  # sentences, characters of one: a screen of `wrcd check`; this project's own choice
# What the estimator in C has room for
MAX_STATES, MAX_RULES, MAX_SETS, MAX_POLYNOMIAL, MAX_SECTIONS, MAX_HIDDEN = (
    int(constant(f"MAX_{name}")) for name in ("STATES", "RULES", "SETS", "POLYNOMIAL", "SECTIONS", "HIDDEN")
)


@dataclass(frozen=True, slots=True)
class Sets:
    """Triangular fuzzy sets of one input that add up to one: centres (m,) growing, flat beyond the first and last.

    One set alone holds fully everywhere: the input chooses no rules.
    """

    names: tuple[str, ...]
    centres: FloatArray

    def memberships(self, x: FloatArray) -> FloatArray:
        """Degree of each set, (n, m) for x (n,)."""
        c = self.centres
        x = np.clip(x, c[0], c[-1])[:, None]
        gaps = np.diff(c)
        rise = np.ones((len(x), len(c)))
        fall = np.ones((len(x), len(c)))
        rise[:, 1:] = (x - c[:-1]) / gaps
        fall[:, :-1] = (c[1:] - x) / gaps
        degrees: FloatArray = np.clip(np.minimum(rise, fall), 0.0, 1.0)
        return degrees


@dataclass(frozen=True, slots=True)
class HealthModel:
    """How a pair of sensors is judged, see health.c: features f, hidden units h, states s."""

    middle: FloatArray  # (f,) and scale (f,): what the features are standardised by
    scale: FloatArray
    hidden: FloatArray  # (f, h)
    hidden_bias: FloatArray  # (h,)
    out: FloatArray  # (h, s)
    out_bias: FloatArray  # (s,)
    temper: FloatArray  # (s,) how much of a span's evidence counts
    log_prior: FloatArray  # (s,) of the states, over that of a sound pair
    kept: float  # of the log odds over the prior's, at each span
    hazard: float  # that a state changes, at each span


@dataclass(frozen=True, slots=True)
class IntervalModel:
    """What half-widths are multiplied by, see interval.c: factors (regimes, v) at growing speeds (v,)."""

    speeds_m_s: FloatArray
    factors: FloatArray


@dataclass(frozen=True, slots=True)
class Design:
    """A loaded design. Matrices are (speeds, models, …), steady-state for one tick at each speed of the grid."""

    name: str
    wheelset: dict[str, Any]  # the wheelset that it is for, as the rig names its parameters
    tick_s: float
    form: str  # "wrcd", or "paper": its own form, see sim_ecu/design/paper.py
    window_s: float  # after so long of sound inputs the estimate is Valid
    longest_s: float  # of the longest window that rules are fitted on
    recent_s: float  # the newest part of the window: shows a change of rail
    speeds_m_s: FloatArray  # (v,)
    model_names: tuple[str, ...]
    Phi: FloatArray  # (v, 4, s, s) state transition over one tick
    K: FloatArray  # (v, 4, s, 2) gain
    H: FloatArray  # (v, 4, 2, s) output
    whiten: FloatArray  # (v, 4, 2, 2) inverse Cholesky factor of the innovation covariance S, rows weighted
    noise_rms: FloatArray  # (2,) of the sensors, per sample: rad/s, m/s2
    noise_power: FloatArray  # (v, 4, 2) power that this noise alone leaves in each model's residual, by channel
    lowpass: FloatArray  # (k, 6) second-order sections that the whitened innovations go through
    highpass: FloatArray  # (k, 6) sections that show pulses in the lateral acceleration
    residual_sets: tuple[Sets, ...]  # over log10 of residuals 1 to 3 over residual 4, and of residual 4
    torque_sets: Sets  # over log10 of |torque| / (2 N r0)
    speed_sets: Sets  # over log10 of the speed in m/s; one alone holds at all speeds
    rules: IntArray  # (r, 6) which set of each input
    low: FloatArray  # (COLUMNS,) the columns are held between these for the outputs
    high: FloatArray
    middle: FloatArray  # (COLUMNS,) of the columns beyond the six; of those the middle of a rule's sets counts
    bases: FloatArray  # (r,) fuzzy output, 0 … 100, in the middle
    consequents: tuple[str, ...]  # (r,) names of the output sets that the bases are of, or () where they are numbers
    slopes: FloatArray  # (r, COLUMNS) its change per unit of each column away from there
    spreads: FloatArray  # (r,) half-width of the 90 % interval, as a share of the adhesion, in the middle
    spread_slopes: FloatArray  # (r, COLUMNS) its change in decades per unit of each column
    typical_pct: FloatArray  # (r, 2) adhesion between which nine tenths of a rule's training data lie
    change_speeds_m_s: FloatArray  # (c,)
    changes: FloatArray  # (c, 4) decades by which a residual of the newest part may differ from the rest's
    beyond: float  # how far outside the sets an input may lie, as a share of their range, before it is unlike training
    polynomial: FloatArray  # highest power first: fuzzy output -> percent adhesion
    adhesion_range_pct: tuple[float, float]
    saturated_share: float  # MuUsed / MuAvailable from which the contact counts as saturated
    normal_N: float
    r_0: float
    interval: IntervalModel | None  # None: the rules' own spread
    health: HealthModel | None  # None: no pair of sensors is judged
    worlds: tuple[str, ...]  # sentences: in what worlds it was trained, and which vehicle it is for; () if it says none
    checksum: str

    @property
    def states(self) -> int:
        """States of each filter."""
        return int(self.Phi.shape[-1])

    @property
    def is_bogie(self) -> bool:
        """Whether its wheelsets stand in bogies."""
        return self.wheelset.get("bogie") is not None

    @property
    def wheelbase_m(self) -> float:
        """From one wheelset to the next on its track."""
        return 2.0 * float(self.wheelset["bogie"]["semi_wheelbase_m"]) if self.is_bogie else NEXT_WHEELSET_M

    @property
    def sets(self) -> tuple[Sets, ...]:
        """The sets of the six inputs of the rules."""
        return (*self.residual_sets, self.torque_sets, self.speed_sets)

    @property
    def window_ticks(self) -> int:
        """Ticks in the window."""
        return max(1, round(self.window_s / self.tick_s))

    @property
    def recent_ticks(self) -> int:
        """Ticks in the newest part of the window."""
        return max(1, round(self.recent_s / self.tick_s))

    @property
    def longest_ticks(self) -> int:
        """Ticks in the longest window."""
        return max(1, round(self.longest_s / self.tick_s))


def stable(sos: FloatArray) -> bool:
    """Whether second-order sections (k, 6), b0 b1 b2 1 a1 a2, have all poles inside the unit circle."""
    a1, a2 = sos[:, 4], sos[:, 5]
    return bool(np.all(sos[:, 3] == 1.0) and np.all(np.abs(a2) < 1.0) and np.all(np.abs(a1) < 1.0 + a2))


def closed_loop(Phi: FloatArray, K: FloatArray, H: FloatArray) -> FloatArray:
    """(…, s, s): what a filter's state decays by in a tick, Phi (I - K H)."""
    out: FloatArray = Phi @ (np.eye(Phi.shape[-1]) - K @ H)
    return out


def filters_stable(Phi: FloatArray, K: FloatArray, H: FloatArray) -> bool:
    """Whether every filter forgets, at the design's speeds (v, …) and in the middle between them."""
    with np.errstate(all="ignore"):
        A = closed_loop(Phi, K, H)
        A = np.concatenate((A, 0.5 * (A[:-1] + A[1:])))
        return bool(np.isfinite(A).all()) and float(np.abs(np.linalg.eigvals(A)).max()) < 1.0


def load_design(path: Path) -> Design:
    """Read and check a design file. Raises InputError: missing, malformed, wrong checksum, wrong shape."""
    try:
        return _parsed(path.read_text(encoding="utf-8"), path)
    except FileNotFoundError:
        raise NotThere("no such design file", file=path, hint="make one with `sim-ecu design -o FILE`") from None
    except json.JSONDecodeError as e:
        raise InputError(f"not valid JSON: {e.msg}", file=path, line=e.lineno) from None
    except OSError as e:
        raise NotThere(f"cannot be read: {e.strerror}", file=path, hint="check your rights and the disk") from None
    except (ValueError, RecursionError) as e:
        raise InputError(f"cannot be read: {e}", file=path) from None


def _parsed(text: str, file: Path) -> Design:
    return parse_design(json.loads(text), file)


def parse_design(document: Any, file: Path | str) -> Design:
    """Check a design document and turn it into arrays."""
    if not isinstance(document, dict) or document.get("format") not in (FORMAT, BEFORE):
        found = document.get("format") if isinstance(document, dict) else type(document).__name__
        hint = "one of an earlier version is made again with `sim-ecu design`"
        raise InputError(f"is not a {FORMAT} file (found {found!r})", file=file, key="format", hint=hint)
    try:
        correct = checksum(document)
    except (ValueError, RecursionError) as e:
        raise InputError(f"cannot be read: {e}", file=file) from None
    if document.get("checksum") != correct:
        raise InputError(
            "does not match the contents",
            file=file,
            key="checksum",
            hint="the file was changed by hand or damaged; make it again with `sim-ecu design`",
        )
    reader = _Reader(document, file)
    design = _arrays(reader, correct)
    _check(design, reader)
    return design


class _Reader:
    def __init__(self, document: dict[str, Any], file: Path | str) -> None:
        self._document, self.file = document, file

    def error(self, key: str, reason: str) -> InputError:
        return InputError(reason, file=self.file, key=key, hint="make the design again with `sim-ecu design`")

    def at(self, key: str) -> Any:
        node: Any = self._document
        for part in key.split("."):
            if not isinstance(node, dict) or part not in node:
                raise self.error(key, "is missing")
            node = node[part]
        return node

    def has(self, key: str) -> bool:
        """Whether the document has a part of that name."""
        return key in self._document

    def array(self, key: str, *shape: int) -> FloatArray:
        """An array of finite numbers; -1 in the shape stands for any length but none."""
        try:
            a = np.array(self.at(key), dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise self.error(key, "is not an array of numbers") from None
        fits = a.ndim == len(shape) and all(
            n == want or (want == -1 and n > 0) for n, want in zip(a.shape, shape, strict=True)
        )
        if not fits or not np.all(np.isfinite(a)):
            raise self.error(key, f"must be finite numbers of shape {shape}, is {a.shape}")
        a.setflags(write=False)
        return a

    def by_column(self, key: str, *shape: int) -> FloatArray:
        """An array whose last axis goes by the columns; of a format with fewer, zeros for the others."""
        given = COLUMNS_BEFORE if self._document["format"] == BEFORE else COLUMNS
        a = np.zeros((*shape, COLUMNS))
        a[..., :given] = self.array(key, *shape, given)
        a.setflags(write=False)
        return a

    def number(self, key: str, low: float, high: float) -> float:
        value = float(self.array(key))
        if not low <= value <= high:
            raise self.error(key, f"must lie within {low:g} … {high:g}, is {value:g}")
        return value

    def names(self, key: str, count: int) -> tuple[str, ...]:
        """So many names, or none where the key is not there."""
        table, last = key.rsplit(".", 1)
        names = self.at(table).get(last, [])
        if not isinstance(names, list) or len(names) not in (0, count):
            raise self.error(key, f"needs {count} names")
        return tuple(str(n) for n in names)

    def are(self, key: str, names: tuple[str, ...]) -> None:
        """Names in the order that this program knows."""
        if self.at(key) != list(names):
            raise self.error(key, f"must be {', '.join(names)}")

    def sentences(self, key: str) -> tuple[str, ...]:
        """Lines for a person, or none where the key is not there."""
        found = self._document.get(key, [])
        if not isinstance(found, list) or len(found) > MAX_WORLDS or not all(map(_is_sentence, found)):
            raise self.error(key, f"takes at most {MAX_WORLDS} sentences of 1 to {MAX_SENTENCE} characters")
        return tuple(found)

    def sets(self, key: str, least: int = 2) -> Sets:
        names = self.at(f"{key}.names")
        centres = self.array(f"{key}.centres", -1)
        if not isinstance(names, list) or len(names) != len(centres) or len(centres) < least:
            raise self.error(key, f"needs {least} or more centres and a name for each")
        if np.any(np.diff(centres) <= 0):
            raise self.error(f"{key}.centres", "must grow")
        return Sets(tuple(str(n) for n in names), centres)


def _is_sentence(value: Any) -> bool:
    return isinstance(value, str) and 0 < len(value) <= MAX_SENTENCE and value.isprintable()


def _arrays(r: _Reader, digest: str) -> Design:
    speeds = r.array("bank.speeds_m_s", -1)
    v = len(speeds)
    wheelset = r.at("inputs.wheelset")
    names = r.at("bank.models")
    if not isinstance(wheelset, dict) or not isinstance(names, list) or len(names) != MODELS:
        raise r.error("bank.models", f"needs {MODELS} models and inputs.wheelset a table")
    if wheelset.get("bogie") is not None:
        r.number("inputs.wheelset.bogie.semi_wheelbase_m", *HALF_WHEELBASES_M)
    rules = r.array("fuzzy.rules", -1, INPUTS)
    n = len(rules)
    Phi = r.array("bank.Phi", v, MODELS, -1, -1)
    states = Phi.shape[-1]
    if Phi.shape[-2] != states or not STATES <= states <= MAX_STATES:
        raise r.error("bank.Phi", f"must be square, with {STATES} to {MAX_STATES} states, is {Phi.shape[-2:]}")
    return Design(
        name=str(r.at("name")),
        wheelset=wheelset,
        tick_s=r.number("bank.tick_s", 1e-4, 0.02),
        form=str(r.at("form")),
        window_s=r.number("window_s", MIN_WINDOW_S, 60.0),
        longest_s=r.number("longest_s", 0.05, 60.0),
        recent_s=r.number("recent_s", 0.005, 60.0),
        speeds_m_s=speeds,
        model_names=tuple(str(m.get("name", i + 1)) if isinstance(m, dict) else str(m) for i, m in enumerate(names)),
        Phi=Phi,
        K=r.array("bank.K", v, MODELS, states, CHANNELS),
        H=r.array("bank.H", v, MODELS, CHANNELS, states),
        whiten=r.array("bank.whiten", v, MODELS, CHANNELS, CHANNELS),
        noise_rms=r.array("bank.noise_rms", CHANNELS),
        noise_power=r.array("bank.noise_power", v, MODELS, CHANNELS),
        lowpass=r.array("bank.lowpass", -1, 6),
        highpass=r.array("bank.highpass", -1, 6),
        residual_sets=tuple(r.sets(f"fuzzy.residual_{m + 1}") for m in range(MODELS)),
        torque_sets=r.sets("fuzzy.torque"),
        speed_sets=r.sets("fuzzy.speed", least=1),
        rules=rules.astype(np.int64),
        low=r.by_column("fuzzy.columns.low"),
        high=r.by_column("fuzzy.columns.high"),
        middle=r.by_column("fuzzy.columns.middle"),
        bases=r.array("fuzzy.bases", n),
        consequents=r.names("fuzzy.consequents", n),
        slopes=r.by_column("fuzzy.slopes", n),
        spreads=r.array("fuzzy.spreads", n),
        spread_slopes=r.by_column("fuzzy.spread_slopes", n),
        typical_pct=r.array("fuzzy.typical_pct", n, 2),
        change_speeds_m_s=r.array("changes.speeds_m_s", -1),
        changes=r.array("changes.limits", len(r.array("changes.speeds_m_s", -1)), MODELS),
        beyond=r.number("fuzzy.beyond", 0.0, 100.0),
        polynomial=r.array("polynomial", -1),
        adhesion_range_pct=(r.number("adhesion_range_pct.low", 0, 100), r.number("adhesion_range_pct.high", 0, 100)),
        saturated_share=r.number("saturated_share", 0.1, 1.0),
        normal_N=r.number("inputs.normal_N", 1.0, 1e6),
        r_0=r.number("inputs.wheelset.r_0", 0.1, 2.0),
        interval=_interval(r) if r.has("interval") else None,
        health=_health(r) if r.has("health") else None,
        worlds=r.sentences("worlds"),
        checksum=digest,
    )


def _interval(r: _Reader) -> IntervalModel:
    speeds = r.array("interval.speeds_m_s", -1)
    factors = r.array("interval.factors", len(Regime), len(speeds))
    r.are("interval.regimes", tuple(x.words for x in Regime))
    if len(speeds) < 2 or np.any(np.diff(speeds) <= 0) or speeds[0] <= 0 or np.any(factors <= 0.0):
        raise r.error("interval.speeds_m_s", "must be two or more growing speeds, and interval.factors positive")
    return IntervalModel(speeds, factors)


def _health(r: _Reader) -> HealthModel:
    s, bias = len(PairState), r.array("health.hidden_bias", -1)
    given = {len(r.array(f"health.{key}", -1)) for key in ("middle", "scale")}
    f = FEATURES_BEFORE if FEATURES_BEFORE in given else PAIR_FEATURES
    r.are("health.states", tuple(x.words for x in PairState))
    scale, prior, temper = (r.array(f"health.{key}", n) for key, n in (("scale", f), ("prior", s), ("temper", s)))
    if not (scale > 0.0).all():
        raise r.error("health.scale", "must be positive")
    if not (temper >= 0.0).all():
        raise r.error("health.temper", "must not be negative")
    if not (prior > 0.0).all() or not (np.abs(np.log(prior / prior[0])) <= CERTAIN).all():
        raise r.error("health.prior", f"must be positive, and within e^±{CERTAIN:g} of that of a sound pair")
    h = len(bias)
    return HealthModel(
        _all_features(r.array("health.middle", f), 0.0), _all_features(scale, 1.0),
        _all_features(r.array("health.hidden", f, h), 0.0), bias, r.array("health.out", h, s),
        r.array("health.out_bias", s), temper, np.log(prior / prior[0]), r.number("health.kept", 0.0, 1.0),
        r.number("health.hazard", 0.0, 0.1),
    )  # fmt: skip


def _all_features(a: FloatArray, other: float) -> FloatArray:
    """An array whose first axis goes by the features that pairs are judged by; of a design of before, with others by
    which nothing moves."""
    out = np.full((PAIR_FEATURES, *a.shape[1:]), other)
    out[: len(a)] = a
    out.setflags(write=False)
    return out


def _check(d: Design, r: _Reader) -> None:
    if len(d.speeds_m_s) < 2 or np.any(np.diff(d.speeds_m_s) <= 0) or d.speeds_m_s[0] <= 0:
        raise r.error("bank.speeds_m_s", "must be two or more growing positive speeds")
    sizes = [len(s.centres) for s in d.sets]
    if np.any(d.rules < 0) or np.any(d.rules >= np.array(sizes)):
        raise r.error("fuzzy.rules", "names a set that does not exist")
    for key, count, most in (
        ("fuzzy.rules", len(d.rules), MAX_RULES), ("polynomial", len(d.polynomial), MAX_POLYNOMIAL),
        ("bank.lowpass", len(d.lowpass), MAX_SECTIONS), ("bank.highpass", len(d.highpass), MAX_SECTIONS),
        ("health.hidden_bias", 0 if d.health is None else len(d.health.hidden_bias), MAX_HIDDEN),
        ("fuzzy: sets of an input", max(sizes), MAX_SETS),
    ):  # fmt: skip
        if count > most:
            raise r.error(key, f"{count} are more than the {most} that the estimator takes")
    if np.any(d.spreads <= 0) or np.any(d.changes <= 0):
        raise r.error("fuzzy.spreads", "must be positive, and changes.limits, too")
    if np.any(d.noise_rms <= 0) or np.any(d.noise_power <= 0):
        raise r.error("bank.noise_rms", "must be positive, and bank.noise_power, too")
    if len(d.change_speeds_m_s) < 2 or np.any(np.diff(d.change_speeds_m_s) <= 0):
        raise r.error("changes.speeds_m_s", "must be two or more growing speeds")
    if not filters_stable(d.Phi, d.K, d.H):
        raise r.error("bank.K", "makes a filter that is not stable")
    for key, sections in (("bank.lowpass", d.lowpass), ("bank.highpass", d.highpass)):
        if not stable(sections):
            raise r.error(key, "is not a stable filter")
    if d.form not in FORMS:
        raise r.error("form", f"must be one of {', '.join(FORMS)}")
    if 2 * d.recent_ticks > d.window_ticks or d.longest_ticks < d.window_ticks:
        raise r.error("recent_s", "must not be longer than half the window, nor the window than longest_s")
    if d.health is not None and d.longest_ticks < SPAN_TICKS:
        raise r.error("longest_s", f"must be {SPAN_TICKS} ticks or more, the span that pairs of sensors are judged by")
    if np.any(d.low > d.high):
        raise r.error("fuzzy.columns.low", "must not be above high")
    if d.adhesion_range_pct[0] >= d.adhesion_range_pct[1]:
        raise r.error("adhesion_range_pct", "low must be below high")
