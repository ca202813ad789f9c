"""`sim-ecu design`."""

import argparse
from pathlib import Path

from wrcd.cli.program import Subcommand
from wrcd.errors import InputError
from wrcd.resources import DEFAULT_DESIGN


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "--config", type=Path, default=Path(DEFAULT_DESIGN), metavar="RIG.toml",
        help="vehicle, design, plan: a file, or a packaged vehicle by its name "
        f"(default: {DEFAULT_DESIGN}; `sim-ecu list` has them)",
    )  # fmt: skip
    p.add_argument("-o", "--output", type=Path, metavar="FILE", help="the file to make")
    p.add_argument(
        "--form",
        choices=("wrcd", "paper"),
        help="wrcd's own form, or the paper's own, which it is compared with (default: as --config says, else wrcd)",
    )
    p.add_argument("--search", action="store_true", help="has moved: `sim-ecu tune --over noise,weights --played 0`")
    for gone in ("--budget", "--jobs"):  # a script that still has them gets an error that names the search
        p.add_argument(gone, metavar="N", help="of the search: has moved with it")
    p.add_argument(
        "--baselines", type=Path, metavar="OUT.json", help="also make what `sim-ecu score` compares this design with"
    )
    p.add_argument(
        "--explain", nargs="?", const=DEFAULT_DESIGN, metavar="DESIGN",
        help="make nothing: print what a design is for, and its rules as sentences, with their data: a packaged design "
        f"by its name, or a file (default: {DEFAULT_DESIGN})",
    )  # fmt: skip


def _run(args: argparse.Namespace) -> int:
    if args.explain is not None:
        from sim_ecu.design.brief import explain
        from wrcd.config.packaged_designs import design_path

        return explain(design_path(args.explain))
    if args.search or args.budget is not None or args.jobs is not None:
        hint = "`sim-ecu tune --over noise,weights --budget 600 --played 0 -o DIR` writes DIR/brief.toml for --config"
        raise InputError("has moved to a command of its own", key="--search", hint=hint)
    if args.output is None:
        raise InputError("is missing", key="-o", hint="name the file to make, or ask for --explain")
    return _make(args)


def _make(args: argparse.Namespace) -> int:
    """Make a design file, and what a score compares it with. Deterministic for one set of library versions."""
    from sim_ecu.design.brief import read_brief
    from sim_ecu.design.make import design, write
    from sim_ecu.play.vehicles import vehicle_path
    from sim_ecu.reporting.result_files import check_output
    from sim_ecu.score.baselines import learn
    from wrcd.config.settings import read_toml
    from wrcd.estimator.design import load_design
    from wrcd.progress import Progress

    brief = read_brief(read_toml(vehicle_path(args.config)), args.form)
    check_output("-o", args.output)
    check_output("--baselines", args.baselines)
    progress = Progress(steps=True)
    document, recordings = design(brief, progress.at)
    write(document, args.output)
    if args.baselines is not None:
        progress.at("baselines", 0.0)
        write(learn(load_design(args.output), recordings, brief.plan), args.baselines)
    progress.end()
    fit = document["fit"]
    print(
        f"{args.output}: {document['name']}, {len(document['fuzzy']['rules'])} rules, "
        f"checksum {document['checksum'][:12]}; "
        f"on its own {fit['windows']} training windows: mean error {fit['mean_error_pp']} pp, "
        f"p95 {fit['p95_error_pp']} pp"
    )
    return 0


COMMAND = Subcommand(
    "design",
    "make the design file of a vehicle (takes minutes)",
    (
        ("sim-ecu design --config metro -o metro.design.json", "the design of a vehicle that comes along"),
        ("sim-ecu design --explain", "the default design's rules as sentences, with their data"),
    ),
    _add,
    _run,
)
