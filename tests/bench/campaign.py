"""What a job of a campaign costs beside its work: `python -m tests.bench.campaign`.

The same jobs, which do nothing, called in a loop, on the pool of processes, on Dask's workers here, and as a whole
campaign whose rows go to a folder. Blocks in turn; asserts nothing.
"""

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from sim_ecu.campaign.campaign_folder import CampaignRequest, opened_store
from sim_ecu.campaign.definition import Campaign
from sim_ecu.campaign.go import go
from sim_ecu.campaign.kind import Factor, Kind, Metric, Type
from sim_ecu.jobs.job import Job, Scalar, Task, answer, code
from sim_ecu.jobs.pool import Workers, local, run

WORKERS = 2


def nothing(job: Job) -> Mapping[str, Scalar]:
    """The work."""
    return {"y": float(job.inputs["seed"])}


KIND = Kind("nothing", "", (Factor("x", Type.NUMBER, ""),), (Metric("y", Type.NUMBER, ""),), nothing)


def main() -> int:
    """Entry point: prints a table."""
    p = argparse.ArgumentParser(prog="python -m tests.bench.campaign", description=__doc__)
    p.add_argument("--count", type=int, default=2000, help="jobs of a block")
    p.add_argument("--blocks", type=int, default=5)
    args = p.parse_args()
    jobs = [Job(KIND.name, {"x": 1.0, "seed": seed}) for seed in range(args.count)]
    tasks = [Task(nothing, job, {}, code(nothing.__module__)) for job in jobs]
    asked = CampaignRequest("nothing", KIND, {"x": Type.NUMBER, "seed": Type.WHOLE}, code(nothing.__module__))
    with ExitStack() as open_:
        pool, cluster, folder = _executors(open_)
        folders = iter(range(args.blocks))

        def whole() -> None:
            campaign = Campaign(asked, tuple(jobs), {}, None, 0, None, folder, {(): {}})
            out = folder / str(next(folders))
            with opened_store(out, asked, campaign.keys) as store:
                go(campaign, out, store, pool)

        ways: dict[str, Callable[[], Any]] = {
            "called in a loop": lambda: [answer(task) for task in tasks],
            f"pool of {WORKERS} processes": lambda: list(run(answer, tasks, pool)),
            "the same, rows kept and merged": whole,
            f"Dask, {WORKERS} workers here": lambda: list(run(answer, tasks, cluster)),
        }
        times: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(args.blocks):
            for name, way in ways.items():
                begun = time.perf_counter()
                way()
                times[name].append(1e6 * (time.perf_counter() - begun) / args.count)
    print("| way | us a job, shortest block | median |\n| --- | --- | --- |")
    for name, found in times.items():
        print(f"| {name} | {min(found):.0f} | {statistics.median(found):.0f} |")
    return 0


def _executors(open_: ExitStack) -> tuple[Workers, Workers, Path]:
    """The pool, Dask's, and a folder; all are warm."""
    import distributed

    make: Any = distributed.LocalCluster
    here = open_.enter_context(
        make(
            n_workers=WORKERS,
            threads_per_worker=1,
            dashboard_address=None,
            host="127.0.0.1",
            worker_dashboard_address=None,
        )
    )
    client = open_.enter_context(here.get_client())
    pool = open_.enter_context(local(WORKERS))
    folder = Path(open_.enter_context(tempfile.TemporaryDirectory()))
    task = Task(nothing, Job(KIND.name, {"x": 1.0, "seed": 0}), {}, code(nothing.__module__))
    cluster = Workers(client.get_executor(pure=False), WORKERS, 16)
    for warmed in (pool, cluster):
        list(run(answer, [task] * 50, warmed))
    return pool, cluster, folder


if __name__ == "__main__":
    from tests.bench.campaign import main as importable  # workers find what it hands them by this module's name

    sys.exit(importable())
