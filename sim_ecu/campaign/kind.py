"""What can be requested: a kind of job, the factors it takes and the figures it gives."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from sim_ecu.jobs.job import Job, Scalar
from wrcd.config.section import suggest
from wrcd.errors import InputError


class Type(Enum):
    """Of a factor's values and of a figure."""

    NUMBER = "a number"
    WHOLE = "a whole number"
    TEXT = "a string"
    FLAG = "true or false"


@dataclass(frozen=True, slots=True)
class Factor:
    """What a campaign may vary. default: None where it must be given, unless it is optional: then it is left out.

    choices: the values it takes; empty for any. is_file: it takes a file's path, empty for none, and what the file
    holds is part of the question. packaged: what has neither suffix nor slash is the name of a file that comes along.
    """

    name: str
    type: Type
    words: str
    default: Scalar = None
    unit: str = ""
    choices: tuple[str, ...] = ()
    is_file: bool = False
    packaged: bool = False
    optional: bool = False

    @property
    def needed(self) -> bool:
        """Whether a campaign must give it."""
        return self.default is None and not self.optional

    def path(self, value: Any) -> Path | None:
        """The file that a value names; None for a packaged one, and for a factor that is none."""
        if not self.is_file or not isinstance(value, str) or not value:
            return None
        return None if self.packaged and not Path(value).suffix and "/" not in value else Path(value)

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
            hint = suggest(str(value), self.choices)
            raise InputError(f"takes one of {', '.join(self.choices)}, not {value!r}", hint=hint)
        return float(value) if self.type is Type.NUMBER else value


@dataclass(frozen=True, slots=True)
class Metric:
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
    seeded: whether a job has an input `seed`, of which a campaign gives several to each point.
    check: raises InputError for inputs that are wrong together, before anything runs. cost: of a job, about, in any
    unit: what the time left is estimated by. suite: the factor by which a comparison groups. cluster: the
    inputs that make a job's world, its track and noise: jobs in which all are equal resemble each other. named: the
    files that an input's file names in turn, by a name of their own. points: the inputs of the jobs that inputs stand
    for, where they leave out optional factors that a job needs.
    """

    name: str
    words: str
    factors: tuple[Factor, ...]
    figures: tuple[Metric, ...]
    function: Callable[[Job], Mapping[str, Scalar]]
    open_factors: tuple[str, ...] = ()
    seeded: bool = True
    check: Callable[[Mapping[str, Any]], object] = lambda inputs: None
    cost: Callable[[Mapping[str, Any]], float] = lambda inputs: 1.0
    suite: str = ""
    cluster: tuple[str, ...] = ("seed",)
    named: Callable[[Mapping[str, Any]], Mapping[str, Path]] = lambda inputs: {}
    points: Callable[[Mapping[str, Any]], Iterable[Mapping[str, Any]]] = lambda inputs: (inputs,)

    def factor(self, name: str) -> Factor | None:
        """By name; None for one that is not listed."""
        return next((f for f in self.factors if f.name == name), None)

    def files(self, inputs: Mapping[str, Any]) -> dict[str, Path]:
        """The files that a job of these inputs reads, packaged ones left out; by factor, or by the name that `named`
        gives: what Job.files has the contents of. Raises InputError for one that cannot be read."""
        own = {f.name: f.path(inputs.get(f.name)) for f in self.factors}
        return {name: path for name, path in own.items() if path is not None} | dict(self.named(inputs))
