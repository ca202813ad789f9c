"""Folders of small campaigns whose figures a test chooses."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu.campaign.campaign_folder import CampaignRequest, merge, opened_store
from sim_ecu.campaign.kind import Kind, Metric, Type
from sim_ecu.jobs.job import Ending, Job, JobRow, Scalar

FIGURES = (
    Metric("mean_error_pp", Type.NUMBER, "mean error", "pp", "less"),
    Metric("valid", Type.NUMBER, "share Valid", "", "more"),
    Metric("slip", Type.WHOLE, "neither way is better"),
    Metric("cause", Type.TEXT, "main cause"),
)
TYPES = {"rail": Type.TEXT, "design": Type.TEXT, "speed": Type.NUMBER, "lot": Type.WHOLE, "seed": Type.WHOLE}
Told = Callable[[Mapping[str, Any]], Mapping[str, Scalar]]  # a job's figures; empty: it failed


def _none(job: Job) -> Mapping[str, Scalar]:
    return {}


def kind(name: str = "drive", figures: tuple[Metric, ...] = FIGURES, cluster: tuple[str, ...] = ("seed",)) -> Kind:
    """One whose rows are told."""
    return Kind(name, "a run", (), figures, _none, suite="rail", cluster=cluster)


def folder(
    path: Path, every: Iterable[Mapping[str, Any]], told: Told, of: Kind | None = None, code: str = "0" * 32
) -> Path:
    """A finished campaign of these inputs."""
    jobs = [Job((of or kind()).name, dict(inputs)) for inputs in every]
    columns = {name: TYPES[name] for name in jobs[0].inputs}
    pairs = []
    for job in jobs:
        figures = told(job.inputs)
        ending = Ending.DONE if figures else Ending.FAILED
        pairs.append((job, JobRow(job.key(code), ending, figures, "" if figures else "it failed")))
    asked = CampaignRequest(f"campaign {path.name}", of or kind(), columns, code)
    with opened_store(path, asked, ()):
        merge(path, asked, pairs)
    return path


def inputs(
    rails: Iterable[str] = ("leaf", "dry"), seeds: Iterable[int] = range(1, 21), **more: Scalar
) -> list[dict[str, Any]]:
    """Every rail with every seed; more are the same in all jobs."""
    return [{"rail": rail, **more, "seed": seed} for rail in rails for seed in seeds]


def steps(shift: float = 0.0, *, own: int = 0, rail: str = "leaf") -> Told:
    """Figures of a world (by rail and seed), a little noise of the campaign's own, and a shift on one rail."""

    def told(job: Mapping[str, Any]) -> dict[str, Scalar]:
        key = [len(job["rail"]), job["seed"]]
        world = np.random.default_rng(key).exponential(size=3)
        noise = np.random.default_rng([own, *key]).normal(size=3)
        by = shift if job["rail"] == rail else 0.0
        return {
            "mean_error_pp": float(world[0] + 0.05 * noise[0] + by),
            "valid": float(0.9 - 0.1 * world[1] + 0.005 * noise[1] - by / 10),
            "slip": int(20 * world[2] + noise[2] + 10 * by),
            "cause": "None",
        }

    return told
