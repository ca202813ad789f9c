"""`sim-ecu design`."""

import argparse
from pathlib import Path

from sim_ecu.cli.arguments import add_jobs, check_least
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError
from wrcd.resources import DEFAULT_DESIGN

BUDGET = 120  # candidates of a search


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
    p.add_argument(
        "--quick",
        action="store_true",
        help="a fifth of the conditions, in five minutes: broken sensors are found less often",
    )
    p.add_argument(
        "--search", metavar="NAME,…",
        help="make no design: search these numbers, noise, weights, points (creep) or band, and write the best brief",
    )  # fmt: skip
    p.add_argument(
        "--budget", type=int, default=BUDGET, metavar="N",
        help=f"candidates of the search, the start among them; each takes ten seconds of a core (default: {BUDGET})",
    )  # fmt: skip
    add_jobs(p)
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
    if args.output is None:
        raise InputError("is missing", key="-o", hint="name the file to make, or ask for --explain")
    check_least(args, budget=1, jobs=1)
    return _make(args) if args.search is None else _search(args)


def _search(args: argparse.Namespace) -> int:
    """Search a brief's numbers, and write the best as a brief."""
    from sim_ecu.design.brief import read_brief, written
    from sim_ecu.design.search import objective_words, search
    from sim_ecu.design.space import parameters
    from sim_ecu.jobs.pool import local
    from sim_ecu.play.vehicles import vehicle_path
    from sim_ecu.reporting.result_files import check_output, save
    from wrcd.config.settings import read_whole
    from wrcd.progress import Progress

    brief, groups = (
        read_whole(vehicle_path(args.config), lambda top, _: read_brief(top, args.form)),
        [name.strip() for name in args.search.split(",")],
    )
    parameters(brief, groups)  # raises InputError before the minutes that it would cost
    check_output("-o", args.output)
    progress = Progress(steps=True)
    try:
        with local(args.jobs) as workers:
            best, least, first = search(brief, groups, args.budget, workers, progress.at)
    finally:
        progress.end()
    errors = f"{objective_words(brief.form)} {least:.4f}; of the start {first:.4f}"
    how = f"Found by `sim-ecu design --search {args.search}` with {args.budget} candidates."
    text = written(best, [how, errors, "Makes a design: `sim-ecu design --config`."])
    save(args.output, lambda partly: partly.write_text(text, encoding="utf-8"))
    print(f"{args.output}: {errors}")
    return 0


def _make(args: argparse.Namespace) -> int:
    """Make a design file, and play it. Deterministic for one set of library versions. Broken off and begun again, it
    simulates only what is missing."""
    from dataclasses import replace

    from sim_ecu.design.brief import read_brief
    from sim_ecu.design.cases import in_a_hurry
    from sim_ecu.design.make import bank, fitted, judging, with_placeholder_rules, write
    from sim_ecu.design.pairs import plan_of, require_learning
    from sim_ecu.design.training_jobs import pairs, recorded, remove_parts
    from sim_ecu.jobs.pool import kept, local
    from sim_ecu.play.suspension import conversions
    from sim_ecu.play.vehicles import vehicle_path
    from sim_ecu.reporting.result_files import check_output, save
    from sim_ecu.score.run_score import short
    from wrcd.config.settings import read_toml, read_whole
    from wrcd.core.design import parse_design
    from wrcd.progress import Progress

    brief = read_whole(vehicle_path(args.config), lambda top, _: read_brief(top, args.form))
    for line in conversions(read_toml(vehicle_path(args.config))):
        print(line)
    if args.quick:
        brief = replace(brief, plan=in_a_hurry(brief.plan))
    check_output("-o", args.output)
    if brief.form == "wrcd":
        require_learning()
    progress = Progress(steps=True)
    parts = args.output.with_name(f"{args.output.name}.parts")
    started = bank(brief)
    with_placeholder_rules(started)  # what is no filter is refused before the minutes that it would cost
    progress.at("gains", 1.0)
    progress.end()
    try:
        with kept(), local(args.jobs) as workers:
            recordings = recorded(brief.wheelset, brief.plan, brief.tick_s, parts, workers, progress.at)
            document = fitted(brief, started, recordings, progress.at, workers)
            if brief.form == "wrcd":
                design = parse_design(document, args.output)
                watched = pairs(brief.wheelset, plan_of(brief.plan), design, parts, workers, progress.at)
                document = judging(document, watched, progress.at, workers)
            save(args.output, lambda partly: write(document, partly))
    finally:
        progress.end()
    remove_parts(parts)
    fit = document["fit"]
    print(
        f"{args.output}: {document['name']}, {len(document['fuzzy']['rules'])} rules, "
        f"checksum {document['checksum'][:12]}; "
        f"on its own {fit['windows']} training windows: mean error {fit['mean_error_pp']} pp, "
        f"p95 {fit['p95_error_pp']} pp"
    )
    if brief.form == "wrcd":
        print(short(args.output, args.jobs))
    return 0


COMMAND = Subcommand(
    "design",
    "make the design file of a vehicle (takes fifteen minutes), and play it",
    (
        ("sim-ecu design --config metro -o metro.design.json", "the design of a vehicle that comes along"),
        ("sim-ecu design --config my-rig.toml --search noise,weights -o better.toml", "a brief with a better bank"),
    ),
    _add,
    _run,
)
