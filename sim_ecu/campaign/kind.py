"""What can be asked: a kind of job, the factors it takes and the figures it gives."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from sim_ecu.campaign.job import Job, Scalar
from wrcd.errors import InputError


class Type(Enum):
    """Of a factor's values and of a figure."""

    NUMBER = "a number"
    WHOLE = "a whole number"
    TEXT = "a string"
    FLAG = "true or false"


@dataclass(frozen=True, slots=True)
class Factor:
    """What a campaign may vary. default: None where it must be given. is_file: its contents are part of the question.

    choices: the values it takes; empty for any.
    """

    name: str
    type: Type
    words: str
    default: Scalar = None
    unit: str = ""
    choices: tuple[str, ...] = ()
    is_file: bool = False

    def check(self, value: Any) -> Scalar:
        """The value in the factor's type. Raises InputError (without place) for one of another type or choice."""
        fits = {
            Type.NUMBER: isinstance(value, int | float) and not isinstance(value, bool),
            Type.WHOLE: isinstance(value, int) and not isinstance(value, bool),
            Type.TEXT: isinstance(value, str),
            Type.FLAG: isinstance(value, bool),
        }
        if not fits[self.type]:
            raise InputError(f"takes {self.type.value}, not {value!r}")
        if self.choices and value not in self.choices:
            raise InputError(f"takes one of {', '.join(self.choices)}, not {value!r}")
        return float(value) if self.type is Type.NUMBER else value


@dataclass(frozen=True, slots=True)
class Figure:
    """What a job gives. better: "less", "more", or "" where neither is. A NUMBER may be NaN: there is none."""

    name: str
    type: Type
    words: str
    unit: str = ""
    better: str = ""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of job.

    function: of a module's top level, the figures of a job by name; pure: the same job gives the same figures anywhere.
    open_factors: prefixes, "scenario." for one, under which a campaign may name keys that are not listed.
    check: raises InputError for inputs that are wrong together, before anything runs. cost: of a job, about, in any
    unit: what the time left is told from. suite: the factor that tells a comparison what belongs together.
    """

    name: str
    words: str
    factors: tuple[Factor, ...]
    figures: tuple[Figure, ...]
    function: Callable[[Job], Mapping[str, Scalar]]
    open_factors: tuple[str, ...] = ()
    check: Callable[[Mapping[str, Any]], None] = lambda inputs: None
    cost: Callable[[Mapping[str, Any]], float] = lambda inputs: 1.0
    suite: str = ""

    def factor(self, name: str) -> Factor | None:
        """By name; None for one that is not listed."""
        return next((f for f in self.factors if f.name == name), None)
