"""`sim-ecu tune`."""

import argparse
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from sim_ecu.cli.arguments import add_jobs, check_least
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError
from wrcd.resources import DEFAULT_DESIGN

if TYPE_CHECKING:
    from sim_ecu.design.make import Brief

BUDGET, PLAYED, SEED = 120, 8, 1
MAX_SEED = 39  # lots of training seeds there are: see sim_ecu/score/suites/run.py


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "--config", type=Path, default=Path(DEFAULT_DESIGN), metavar="RIG.toml",
        help="where the search starts, and what it is for: a file or a packaged vehicle, as of `sim-ecu design` "
        f"(default: {DEFAULT_DESIGN})",
    )  # fmt: skip
    p.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="folder of all that is found; made")
    p.add_argument("--form", choices=("wrcd", "paper"), help="as of `sim-ecu design` (default: as --config says)")
    p.add_argument(
        "--over", metavar="NAME,…",
        help="what is searched: noise, weights, points (creep), band, window, rules (default: all that the form has)",
    )  # fmt: skip
    p.add_argument(
        "--budget", type=int, default=BUDGET, metavar="N",
        help="candidates that are judged by recorded conditions, the start among them; each takes some ten seconds of "
        f"a core (default: {BUDGET}: 20 minutes of a core)",
    )  # fmt: skip
    p.add_argument(
        "--played", type=int, default=PLAYED, metavar="N",
        help="designs that are played on whole runs, the start among them, each a minute of a core; 0: make none, "
        f"write the best candidate (default: {PLAYED})",
    )  # fmt: skip
    p.add_argument("--seed", type=int, default=SEED, metavar="N", help=f"of the search and its runs (default: {SEED})")
    add_jobs(p)
    p.add_argument(
        "--against", metavar="DESIGN",
        help="the design to reach: a packaged one by its name, or a file (default: "
        f"{DEFAULT_DESIGN}; for another wheelset the start's)",
    )  # fmt: skip


def _run(args: argparse.Namespace) -> int:
    from sim_ecu.campaign.tune.stages import Tuning, tune
    from sim_ecu.design.brief import read_brief
    from sim_ecu.design.pairs import require_learning
    from sim_ecu.design.space import groups_of, parameters
    from sim_ecu.play.vehicles import vehicle_path
    from wrcd.config.packaged_designs import design_path
    from wrcd.config.settings import read_toml

    check_least(args, budget=1, jobs=1, played=0, seed=0)
    if args.seed > MAX_SEED:
        raise InputError(f"takes a whole number from 0 to {MAX_SEED}, not {args.seed}", key="--seed")
    start = read_brief(read_toml(vehicle_path(args.config)), args.form)
    groups = groups_of(start.form) if args.over is None else tuple(name.strip() for name in args.over.split(","))
    parameters(start, groups)  # raises InputError
    if args.played and start.form == "wrcd":
        require_learning()  # before the search: the design that is chosen needs it
    against = None if args.against is None else design_path(args.against)
    if against is not None:
        _fits(against, start)
    try:
        args.output.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot be made: {e.strerror}", file=args.output, key="-o", hint="name a folder") from None
    return tune(Tuning(start, groups, args.budget, args.played, args.seed, args.jobs, against), args.output)


def _fits(against: Path, start: "Brief") -> None:
    """Raise InputError for a design that is not for the same wheelset and tick."""
    from sim_ecu.design.brief import load_source
    from sim_ecu.physics.wheelset import Wheelset

    source = load_source(against)
    pairs = {"tick_s": (source.design.tick_s, start.tick_s)}
    numbers = [f.name for f in fields(Wheelset) if f.name != "name"]
    pairs |= {n: (getattr(source.wheelset, n), getattr(start.wheelset, n)) for n in numbers}
    for key, (theirs, wanted) in pairs.items():
        if theirs != wanted:
            raise InputError(
                f"has {key} = {theirs:g}, what is tuned {wanted:g}", file=against, key="--against",
                hint="only designs for the same wheelset and tick can be compared on the same frames",
            )  # fmt: skip


COMMAND = Subcommand(
    "tune",
    "search a design on training seeds, and compare it with the shipped one on test seeds (takes an hour)",
    (
        ("sim-ecu tune --config my-rig.toml -o tuned", "from a brief on; again with the same folder: goes on"),
        ("sim-ecu tune --over noise,weights --played 0 -o noise", "only the process noise and weights, as a brief"),
    ),
    _add,
    _run,
)
