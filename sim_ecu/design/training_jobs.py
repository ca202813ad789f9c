"""The training's simulations as jobs, a group of conditions each. What is recorded is kept till the design is there."""

import hashlib
import io
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TypeVar

import numpy as np

from sim_ecu.design.cases import Group, Plan, Progress, draw
from sim_ecu.design.pairs import LOOKING, Watched, watched
from sim_ecu.design.recordings import SIMULATING, Recording, record_group
from sim_ecu.jobs.digests import key_of
from sim_ecu.jobs.pool import Workers
from sim_ecu.jobs.whole import each
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.reporting.result_files import BESIDE, save
from wrcd.core.design import Design
from wrcd.errors import InputError

PART = ".part"  # the suffix of a kept recording: the SHA-256 of what follows, which is numpy's npz
DIGEST_BYTES = hashlib.sha256().digest_size
R = TypeVar("R", Recording, Watched)


@dataclass(frozen=True, slots=True)
class GroupJob:
    """The group at a place of a plan: it is drawn from all the others, which name it."""

    wheelset: Wheelset
    plan: Plan
    tick_s: float
    place: int
    group: Group

    @property
    def key(self) -> str:
        """The same for the same recording by the same code."""
        inputs = {
            "wheelset": asdict(self.wheelset), "plan": asdict(self.plan), "tick_s": self.tick_s, "place": self.place,
        }  # fmt: skip
        return key_of({"group": inputs})


def simulate(job: GroupJob) -> Recording:
    """Return the group's recording."""
    return record_group(job.wheelset, job.plan, job.tick_s, job.group, job.place)


@dataclass(frozen=True, slots=True)
class PairsJob:
    """The same, for pairs of sensors; the design is that which looks at them."""

    wheelset: Wheelset
    plan: Plan
    design: Design
    place: int
    group: Group

    @property
    def key(self) -> str:
        """The same for the same pairs by the same code."""
        inputs = {
            "wheelset": asdict(self.wheelset), "plan": asdict(self.plan), "design": self.design.checksum,
            "place": self.place,
        }  # fmt: skip
        return key_of({"pairs": inputs})


J = TypeVar("J", GroupJob, PairsJob)


def look(job: PairsJob) -> Watched:
    """Return what its pairs of sensors give."""
    return watched(job.wheelset, job.design, job.plan, job.group, job.place)


def recorded(
    w: Wheelset, plan: Plan, tick_s: float, folder: Path, workers: Workers, progress: Progress
) -> list[Recording]:
    """Return the recordings of a plan's groups. Each is kept in the folder, which is made, as soon as it is there; what
    an earlier go has kept is not simulated again.

    Raises InputError where the folder or a file cannot be written, and Stopped where a group fails twice.
    """
    jobs = [GroupJob(w, plan, tick_s, place, group) for place, group in enumerate(draw(plan, w))]
    return _done(jobs, simulate, Recording, folder, workers, progress, SIMULATING)


def pairs(w: Wheelset, plan: Plan, design: Design, folder: Path, workers: Workers, progress: Progress) -> list[Watched]:
    """Return the pairs of sensors of a plan's groups, kept alike. Raises as recorded() does."""
    jobs = [PairsJob(w, plan, design, place, group) for place, group in enumerate(draw(plan, w))]
    return _done(jobs, look, Watched, folder, workers, progress, LOOKING)


def _done(
    jobs: Sequence[J], run: Callable[[J], R], kind: type[R], folder: Path, workers: Workers, progress: Progress,
    doing: str,
) -> list[R]:  # fmt: skip
    try:
        folder.mkdir(exist_ok=True)
    except OSError as e:
        hint = "check its folder and your rights"
        raise InputError(f"cannot be made: {e.strerror}", file=folder, hint=hint) from None
    files = [folder / f"{job.key}{PART}" for job in jobs]
    found = {place: r for place, file in enumerate(files) if (r := _read(file, kind)) is not None}
    if found:
        print(f"{folder}: {len(found)} of {len(jobs)} groups were there")
    left = [job for job in jobs if job.place not in found]
    names = [f"group {job.place + 1} of {len(jobs)}, {job.group.speed_m_s:.1f} m/s" for job in left]
    for number, (k, result) in enumerate(each(run, left, workers, names), 1):
        place = left[k].place
        _keep(result, files[place])
        found[place] = result
        progress(doing, number / len(left))
    return [found[place] for place in range(len(jobs))]


def remove_parts(folder: Path) -> None:
    """Remove what `recorded` and `pairs` keep, and the folder where it holds nothing else."""
    for suffix in (PART, BESIDE):
        for file in folder.glob(f"*{suffix}"):
            file.unlink()
    with suppress(OSError):
        folder.rmdir()


def _keep(result: Recording | Watched, file: Path) -> None:
    """Raises InputError where it cannot be written."""
    arrays = io.BytesIO()
    np.savez(arrays, **{f.name: getattr(result, f.name) for f in fields(result)})
    content = arrays.getvalue()
    save(file, lambda partly: partly.write_bytes(hashlib.sha256(content).digest() + content))


def _read(file: Path, kind: type[R]) -> R | None:
    """What was kept; None where there is none, or a damaged one."""
    try:
        content = file.read_bytes()
    except OSError:
        return None
    digest, arrays = content[:DIGEST_BYTES], content[DIGEST_BYTES:]
    if hashlib.sha256(arrays).digest() != digest:
        return None
    with np.load(io.BytesIO(arrays)) as kept:
        return kind(**{name: a if a.ndim else a.item() for name, a in kept.items()})
