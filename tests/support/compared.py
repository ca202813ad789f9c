"""Folders of small campaigns whose figures a test chooses."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from sim_ecu.campaign.job import Ending, Job, Row, Scalar
from sim_ecu.campaign.kind import Figure, Kind, Type
from sim_ecu.campaign.store import Asked, Store

FIGURES = (
    Figure("error", Type.NUMBER, "mean error", "pp", "less"),
    Figure("valid", Type.NUMBER, "share Valid", "", "more"),
    Figure("slip", Type.WHOLE, "neither way is better"),
    Figure("cause", Type.TEXT, "main cause"),
)
TYPES = {"rail": Type.TEXT, "design": Type.TEXT, "speed": Type.NUMBER, "lot": Type.WHOLE, "seed": Type.WHOLE}
Told = Callable[[Mapping[str, Any]], Mapping[str, Scalar]]  # a job's figures; empty: it failed


def _none(job: Job) -> Mapping[str, Scalar]:
    return {}


def kind(name: str = "drive", figures: tuple[Figure, ...] = FIGURES, cluster: tuple[str, ...] = ("seed",)) -> Kind:
    """One whose rows are told."""
    return Kind(name, "a run", (), figures, _none, suite="rail", cluster=cluster)


def folder(
    path: Path, every: Iterable[Mapping[str, Any]], told: Told, of: Kind | None = None, code: str = "0" * 32
) -> Path:
    """A finished campaign of these inputs."""
    jobs = [Job((of or kind()).name, dict(inputs)) for inputs in every]
    columns = {name: TYPES[name] for name in jobs[0].inputs}
    with Store(path, Asked(f"campaign {path.name}", of or kind(), columns, code)) as store:
        for job in jobs:
            figures = told(job.inputs)
            ending = Ending.DONE if figures else Ending.FAILED
            store.add(Row(job.key(code), ending, figures, "" if figures else "it failed"))
        store.merge(jobs)
    return path


def inputs(
    rails: Iterable[str] = ("leaf", "dry"), seeds: Iterable[int] = range(1, 21), **more: Scalar
) -> list[dict[str, Any]]:
    """Every rail with every seed; more are the same in all jobs."""
    return [{"rail": rail, **more, "seed": seed} for rail in rails for seed in seeds]
