"""CAMPAIGN.toml: the request, as a list of jobs whose inputs are checked."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

from sim_ecu.campaign import factors
from sim_ecu.campaign.campaign_folder import CampaignRequest
from sim_ecu.campaign.factors import SEED, Point, Spread, drawn, full, read_factors
from sim_ecu.campaign.kind import Kind, Type
from sim_ecu.campaign.kinds.drive import DRIVE
from sim_ecu.campaign.kinds.log import KIND as LOG
from sim_ecu.campaign.kinds.play_kind import PLAY
from sim_ecu.campaign.kinds.score import SCORE
from sim_ecu.jobs.job import Job, Task, code, digest
from wrcd.config.section import Section, suggest
from wrcd.config.settings import read_toml
from wrcd.errors import InputError, InputErrors

KINDS: tuple[Kind, ...] = (DRIVE, PLAY, SCORE, LOG)
MAX_JOBS = 1_000_000
MOST_NAMED = 20  # mistakes in jobs: more would say the same
Checked = Callable[[int, int], None]


@dataclass(frozen=True)
class Campaign:
    """What a file requests. jobs: each once, file names as they are written. folder: what those are relative to.

    factors: those that vary, with their values. seeds: of every point; None for a kind without. twice: points that were
    drawn more than once. limit_s: None for none.
    paths: by the values of the factors that are files: contents of what is read, by absolute path.
    """

    request: CampaignRequest
    jobs: tuple[Job, ...]
    factors: Mapping[str, Spread]
    seeds: range | None
    twice: int
    limit_s: float | None
    folder: Path
    paths: Mapping[tuple[Any, ...], Mapping[str, str]]

    @cached_property
    def keys(self) -> list[str]:
        """The jobs' keys, in their order."""
        return [job.key(self.request.code) for job in self.jobs]

    def task(self, job: Job) -> Task:
        """The job as it goes to a worker."""
        request, inputs = self.request, placed(self.request.kind, job.inputs, self.folder)
        kind, files = request.kind, self.paths[_files(request.kind, inputs)]
        return Task(kind.function, Job(job.kind, inputs, job.files), files, request.code)

    def cost(self, job: Job) -> float:
        """Return about what the job costs, in the kind's unit."""
        return self.request.kind.cost(placed(self.request.kind, job.inputs, self.folder))


def load_campaign(file: Path, checked: Checked = lambda _done, _of: None) -> Campaign:
    """Read and check everything: the file, then every job's inputs as its kind can. Raises InputError, or InputErrors
    with all mistakes. checked: called with how many of how many are checked."""
    top = read_toml(file, collect=True)
    method = factors.METHOD.value(top)
    count, draw = _drawn_points(top, method), factors.DRAW.value(top)
    title, limit_s = factors.TITLE.read(top) or file.stem, factors.LIMIT.read(top)
    kind = _kind(top)
    seeds = _seeds(top, kind)
    fixed, varied = read_factors(top, kind, method == factors.FULL)
    top.done()
    top.finish()
    stays: Point = {name: g.every()[0] for name, g in fixed.items()}
    runs = (len(seeds) if seeds else 1) * (count or math.prod(len(s.every()) for s in varied.values()))
    if runs > MAX_JOBS:
        raise top.error(f"there are {runs} jobs, more than {MAX_JOBS}", hint="fewer values, or method latin")
    every = list(drawn(varied, method, count, draw) if varied and count else full(varied))
    drawn_once = list({tuple(p.items()): stays | p for p in every}.values())
    folder = file.parent
    points = [p for point in drawn_once for p in _meant(kind, point, folder, top)]
    types = {name: g.type for name, g in (fixed | varied).items()}
    types |= {f.name: f.type for f in kind.factors if f.name in points[0] and f.name not in types}
    types |= {SEED: Type.WHOLE} if seeds else {}
    jobs, paths = _jobs(kind, seeds, points, folder, top, checked)
    request = CampaignRequest(title, kind, types, code(kind.function.__module__))
    return Campaign(request, jobs, varied, seeds, len(every) - len(drawn_once), limit_s, folder.resolve(), paths)


def placed(kind: Kind, inputs: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The inputs with file names that can be opened from here; folder is what they were relative to."""
    out = dict(inputs)
    for factor in kind.factors:
        if (path := factor.path(out.get(factor.name))) is not None:
            out[factor.name] = str(folder / path)
    return out


def _meant(kind: Kind, point: Point, folder: Path, top: Section) -> Iterator[Point]:
    """The points that one stands for, file names as they are written. Raises InputError."""
    try:
        for inputs in kind.points(placed(kind, point, folder)):
            yield {**inputs, **point}
    except InputError as e:
        raise _of_job(e, point, top) from None


def _kind(top: Section) -> Kind:
    """Raises InputError without one, for nothing else can be read then."""
    names = [k.name for k in KINDS]
    name = top.get(factors.KIND.name, str, "")
    kind = next((k for k in KINDS if k.name == name), None)
    if kind is None:
        reason = "is missing" if "kind" not in top else f"is {name!r}, which is no kind"
        top.mistake(top.error(reason, "kind", suggest(name, names) or f"kinds: {', '.join(names)}"))
        top.finish()
        raise AssertionError
    return kind


def _drawn_points(top: Section, method: str) -> int:
    """0 of a full factorial."""
    points = factors.POINTS.read(top)
    for key in (factors.POINTS.name, factors.DRAW.name):
        if method == factors.FULL and key in top:
            top.mistake(top.error("is of method random or latin", key, "a full factorial takes all combinations"))
    if method != factors.FULL and factors.POINTS.name not in top:
        top.mistake(top.absent(factors.POINTS.name, "how many points to draw"))
    return points or 0


def _seeds(top: Section, kind: Kind) -> range | None:
    if not kind.seeded:
        for key in (factors.SEEDS.name, factors.FIRST_SEED.name):
            if top.raw(key) is not None:
                top.mistake(top.error(f"is not of {kind.name}, which has no seed", key, "leave it out"))
        return None
    first = factors.FIRST_SEED.value(top)
    return range(first, first + factors.SEEDS.value(top))


def _jobs(
    kind: Kind, seeds: range | None, points: Sequence[Point], folder: Path, top: Section, checked: Checked
) -> tuple[tuple[Job, ...], dict[tuple[Any, ...], dict[str, str]]]:
    """Jobs of all points, and what they read. Every point is checked with its first seed: the others are like it."""
    named: dict[tuple[Any, ...], dict[str, str]] = {}
    paths: dict[tuple[Any, ...], dict[str, str]] = {}
    jobs: list[Job] = []
    mistakes: dict[str, InputError] = {}
    for k, point in enumerate(points):
        first = {**point, SEED: seeds.start} if seeds else point
        inputs = placed(kind, first, folder)
        try:
            own = _files(kind, inputs)
            if own not in named:
                found = {name: (path, digest(path)) for name, path in kind.files(inputs).items()}
                named[own] = {name: d for name, (_, d) in found.items()}
                absolute = _files(kind, placed(kind, point, folder.resolve()))
                paths[absolute] = {str(path.resolve()): d for path, d in found.values()}
            kind.check(inputs)
        except InputError as e:
            for mistake in e.errors if isinstance(e, InputErrors) else (e,):
                mistakes.setdefault(str(mistake), _of_job(mistake, point, top))
            if len(mistakes) >= MOST_NAMED:
                break
            continue
        checked(k + 1, len(points))
        jobs += (Job(kind.name, i, named[own]) for i in _with_seeds(point, seeds))
    if mistakes:
        few = list(islice(mistakes.values(), MOST_NAMED))
        raise few[0] if len(few) == 1 else InputErrors(few)
    return tuple(jobs), paths


def _with_seeds(point: Point, seeds: Iterable[int] | None) -> Iterator[Point]:
    if seeds is None:
        yield point
    else:
        yield from ({**point, SEED: seed} for seed in seeds)


def _of_job(e: InputError, point: Point, top: Section) -> InputError:
    """A mistake in a file stands there; one in the inputs is the campaign's, at the first point that has it."""
    if e.file is not None:
        return e
    reason = f"{e.reason} (at {as_words(point)})"
    table = next((t for t in (top.section("factor"), top.section("fixed")) if e.key in t), None)
    if table is not None:
        return table.error(reason, e.key, e.hint)
    return InputError(reason, file=top.file, key=e.key, hint=e.hint)


def _files(kind: Kind, inputs: Mapping[str, Any]) -> tuple[Any, ...]:
    """The values of the factors that are files."""
    return tuple(inputs.get(f.name) for f in kind.factors if f.is_file)


def as_words(inputs: Mapping[str, Any]) -> str:
    """Return a job's inputs in a line, for a person."""
    return ", ".join(f"{name} = {_shown(value)}" for name, value in inputs.items())


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)
