"""What can be asked: a kind of job, the factors it takes and the figures it gives; and a job."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from sim_ecu.jobs.digests import digest
from wrcd.config.section import suggest
from wrcd.errors import InputError

Scalar: TypeAlias = str | int | float | bool | None
Type: TypeAlias = type[str] | type[int] | type[float] | type[bool]  # of a factor's values and of a figure
WORDS: dict[Type, str] = {float: "a number", int: "a whole number", str: "a string", bool: "true or false"}


@dataclass(frozen=True, slots=True)
class Factor:
    """What a campaign may vary; docs/reference/campaign.md says what each is. choices: of values; empty for any.

    is_file: it takes a file's path, empty for none, and what the file holds is part of the question. packaged: what
    has neither suffix nor slash is the name of a file that comes along.
    """

    name: str
    type: Type
    needed: bool = False
    choices: tuple[str, ...] = ()
    is_file: bool = False
    packaged: bool = False

    def path(self, value: Any) -> Path | None:
        """Return the file that a value names; None for a packaged one, and for a factor that is none."""
        if not self.is_file or not isinstance(value, str) or not value:
            return None
        return None if self.packaged and not Path(value).suffix and "/" not in value else Path(value)

    def check(self, value: Any) -> Scalar:
        """Return a value in the factor's type. Raises InputError (without place) for one of another type or choice."""
        found: Scalar = float(value) if type(value) is int and self.type is float else value
        if type(found) is not self.type:
            raise InputError(f"takes {WORDS[self.type]}, not {value!r}")
        if self.choices and found not in self.choices:
            hint = suggest(str(found), self.choices)
            raise InputError(f"takes one of {', '.join(self.choices)}, not {value!r}", hint=hint)
        return found


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of job. function: of a module's top level, the figures of inputs; pure: the same anywhere.

    suite: the factor by which a summary groups. open_factors: prefixes of keys that are not listed. seeded: whether
    a job has an input `seed`. check: what a job costs, about, in any unit; raises InputError for inputs that are wrong
    together. named: the files that an input's file names in turn. points: what inputs stand for that leave out factors.
    """

    name: str
    factors: tuple[Factor, ...]
    figures: Mapping[str, Type]
    function: Callable[[Mapping[str, Any]], Mapping[str, Scalar]]
    suite: str
    open_factors: tuple[str, ...] = ()
    seeded: bool = True
    check: Callable[[Mapping[str, Any]], float] = lambda inputs: 1.0
    named: Callable[[Mapping[str, Any]], Mapping[str, Path]] = lambda inputs: {}
    points: Callable[[Mapping[str, Any]], Iterable[Mapping[str, Any]]] = lambda inputs: (inputs,)

    def own_files(self, inputs: Mapping[str, Any]) -> dict[str, Path]:
        """Return the files that inputs name, by factor."""
        found = {f.name: f.path(inputs.get(f.name)) for f in self.factors}
        return {name: path for name, path in found.items() if path is not None}

    def placed(self, inputs: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
        """Return the inputs with file names that can be opened from anywhere; folder is what they were relative to."""
        own = {name: str(folder / path) for name, path in self.own_files(inputs).items()}
        return {**inputs, **own} if own else inputs


@dataclass(frozen=True, slots=True)
class Job:
    """One row to be. key: of all that its figures depend on. inputs: as the campaign's file has them; given: as a
    worker gets them, file names absolute. files: contents (SHA-256) by path."""

    key: str
    inputs: Mapping[str, Scalar]
    given: Mapping[str, Any]
    files: Mapping[str, str]
    cost: float
    function: Callable[[Mapping[str, Any]], Mapping[str, Scalar]]


def answer(job: Job) -> Mapping[str, Scalar]:
    """Return a job's figures. Raises InputError where a file is not, or no longer, what the campaign began with."""
    _check_files(job)
    figures = job.function(job.given)
    _check_files(job)
    return figures


def _check_files(job: Job) -> None:
    for name, was in job.files.items():
        if digest(Path(name)) != was:
            raise InputError("is not as it was when the campaign began", file=name, hint="begin it again")
