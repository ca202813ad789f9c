"""The sim-ecu command."""

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sim_ecu.commands.extra import explained
from sim_ecu.score.names import SUITES
from wrcd import resources
from wrcd.tools.cli import guarded
from wrcd.tools.version import Version

if TYPE_CHECKING:
    from sim_ecu.play.scenario import Scenario

BUDGET = 600  # of `sim-ecu design --search`


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit status: see Status."""
    args = _parser().parse_args(argv)
    return guarded("sim-ecu", lambda: explained(lambda: _COMMANDS[args.command](args)))


def _parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="sim-ecu", description="The rig: nonlinear wheelsets on a CAN bus.")
    p.add_argument("--version", action=Version, help="print versions of package, design and formats, and end")
    commands = p.add_subparsers(dest="command", required=True, metavar="COMMAND")

    commands.add_parser("list", help="the packaged scenarios")

    player = argparse.ArgumentParser(add_help=False)
    player.add_argument(
        "-i", "--interface", default="socketcan",
        help="python-can interface (default: socketcan), or slcan: an interface of our own making (needs root)",
    )  # fmt: skip
    player.add_argument("-c", "--channel", default="vcan0", help="its channel (default: vcan0)")
    player.add_argument(
        "--log", type=Path, metavar="OUT.log", help="write the frames to a log (the suffix is its format)"
    )
    player.add_argument("--fast", action="store_true", help="no bus: as fast as it computes, into --log")
    player.add_argument(
        "--config", type=Path, metavar="FILE",
        help="speak the train's own DBC: send what this configuration of the daemon maps (default: the packaged DBC)",
    )  # fmt: skip
    player.add_argument("--no-truth", action="store_true", help="leave the SimTruth frames out")
    player.add_argument(
        "--ahead", action="store_true", help="make all frames before the first is sent: a slow computer keeps time"
    )

    play = commands.add_parser("play", parents=[player], help="play a scenario onto a bus, or into a log")
    play.add_argument("scenario", help="name of a packaged scenario, or a .toml file")

    inject = commands.add_parser("inject", parents=[player], help="play a scenario with faults")
    inject.add_argument("scenario", nargs="?", help="name of a packaged scenario, or a .toml file")
    inject.add_argument(
        "--fault", action="append", default=[], metavar="SPEC",
        help="KIND:at=S,for=S,of=SIGNAL,axle=N,amount=X, e.g. crc:at=3,for=0.5,of=yaw_rate,axle=1; may be repeated",
    )  # fmt: skip
    inject.add_argument("--list", action="store_true", help="the kinds of fault")

    commands.add_parser("faults", help="the daemon's core under every kind of fault: what it must do, and what it did")

    design = commands.add_parser("design", help="make the design file of a wheelset (takes minutes)")
    design.add_argument(
        "--config", type=Path, metavar="RIG.toml",
        help="wheelset, design, plan: a file, or metro or locomotive, which come along (default: the default wheelset)",
    )  # fmt: skip
    design.add_argument("-o", "--output", type=Path, metavar="FILE", help="the file to make")
    design.add_argument(
        "--form",
        choices=("wrcd", "paper"),
        help="wrcd's own form, or the paper's own, which it is compared with (default: as --config says, else wrcd)",
    )
    design.add_argument(
        "--search",
        action="store_true",
        help="make no design, but look for the models' process noise, and write the best to FILE as TOML (hours)",
    )
    design.add_argument(
        "--budget", type=int, default=BUDGET, metavar="N", help=f"candidates of a search (default: {BUDGET})"
    )
    design.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes of a search for the paper's form (default: all cores)",
    )
    design.add_argument(
        "--baselines", type=Path, metavar="OUT.json", help="also make what `sim-ecu score` compares this design with"
    )
    design.add_argument(
        "--explain", type=Path, nargs="?", const=resources.DESIGN, metavar="DESIGN.json",
        help="make nothing: print the rules of a design (default: the packaged one) as sentences, with their data",
    )  # fmt: skip

    contact = commands.add_parser("contact", help="creep forces of the rig's contact law for the cases of a CSV")
    contact.add_argument("cases", type=Path, metavar="CASES.csv")
    contact.add_argument("--k-a", type=float, default=1.0, metavar="K", help="reduction in the area of adhesion (1)")
    contact.add_argument("--k-s", type=float, default=1.0, metavar="K", help="reduction in the area of slip (1)")

    score = commands.add_parser("score", help="how good a design is, with baselines beside it")
    score.add_argument("--suite", choices=SUITES, help="only this one")
    score.add_argument(
        "--quick", action="store_true", help="a twelfth of the runs, too few to judge most goals: one to two minutes"
    )
    score.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)"
    )
    score.add_argument("--design", type=Path, metavar="DESIGN.json", help="default: the packaged one")
    score.add_argument(
        "--baselines", type=Path, metavar="FILE", help="what `sim-ecu design --baselines` made with the design"
    )
    score.add_argument(
        "--beside", action="append", default=[], metavar="NAME=DESIGN.json",
        help="another design for the same wheelset, run on the same frames; may be repeated",
    )  # fmt: skip
    score.add_argument("--json", type=Path, metavar="OUT", help="all figures")
    score.add_argument("--html", type=Path, metavar="OUT", help="a page with tables and pictures")

    figures = commands.add_parser("figures", help="the paper's figures, and whether they show what it says")
    figures.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    figures.add_argument("--design", type=Path, metavar="DESIGN.json", help="default: the packaged one")
    figures.add_argument(
        "--paper", type=Path, metavar="DESIGN.json",
        help="a design in the paper's own form, judged beside it (default: the packaged one, for the default wheelset)",
    )  # fmt: skip

    verify = commands.add_parser("verify", help="run the fast and the reference engine over a log and compare them")
    verify.add_argument("log", type=Path, metavar="LOG")
    verify.add_argument("--config", type=Path, metavar="FILE", help="the daemon's configuration")
    verify.add_argument(
        "--fuzzy-every", type=float, default=0.1, metavar="S", help="compare the fuzzy output so often (default 0.1 s)"
    )

    demo = commands.add_parser("demo", help="rig and daemon on one bus, the estimate against the truth")
    demo.add_argument("-i", "--interface", help="default: socketcan on vcan0 where there is one, else virtual")
    demo.add_argument("-c", "--channel", help="its channel")
    demo.add_argument("--config", type=Path, metavar="FILE", help="configuration of both (default: the packaged DBC)")
    demo.add_argument("--scenario", default="leaf-patch")
    demo.add_argument("-o", "--output", type=Path, default=Path("build/demo"), metavar="DIR")
    return p


def _list(_args: argparse.Namespace) -> int:
    from sim_ecu.play.scenario import load_scenario, packaged

    for name in packaged():
        s = load_scenario(name)
        print(f"{name:14} {s.duration_s:4.0f} s, {len(s.axles)} axle{'s' * (len(s.axles) > 1)}: {s.title}")
    return 0


def _play(args: argparse.Namespace) -> int:
    from sim_ecu.play.scenario import load_scenario

    return _played(load_scenario(args.scenario), args)


def _inject(args: argparse.Namespace) -> int:
    from dataclasses import replace

    from sim_ecu.play.faults import listing, parse_fault
    from sim_ecu.play.scenario import load_scenario
    from wrcd.errors import InputError

    if args.list:
        print(listing())
        return 0
    if args.scenario is None:
        raise InputError("is missing", key="SCENARIO", hint="see sim-ecu list; --list names the faults")
    scenario = load_scenario(args.scenario)
    numbers = [a.number for a in scenario.axles]
    faults = (*scenario.faults, *(parse_fault(spec, numbers) for spec in args.fault))
    if not faults:
        raise InputError("is missing", key="--fault", hint="--list names the kinds")
    return _played(replace(scenario, faults=faults), args)


def _faults(_args: argparse.Namespace) -> int:
    from sim_ecu.play.matrix import run

    return run()


def _played(scenario: "Scenario", args: argparse.Namespace) -> int:
    from sim_ecu.play.play import play_on_bus, play_to_log
    from sim_ecu.play.train import PACKAGED, Train
    from wrcd.errors import InputError

    train: Train = PACKAGED
    if args.config is not None:
        from sim_ecu.play.mapped import load_train

        train = load_train(args.config, scenario)
    if args.fast:
        if args.log is None:
            raise InputError("--fast needs --log OUT.log to write to")
        began = time.monotonic()
        tally = play_to_log(scenario, args.log, not args.no_truth, train)
        ratio = scenario.duration_s / (time.monotonic() - began)
        print(
            f"sim-ecu: {args.log}: {tally.frames} frames, {scenario.duration_s:g} s at {ratio:.0f} x real time",
            file=sys.stderr,
        )
    else:
        truth = not args.no_truth
        tally = play_on_bus(scenario, args.interface, args.channel, args.log, truth, args.ahead, train)
        print(f"sim-ecu: {tally.text()}", file=sys.stderr)
    return 0


def _design(args: argparse.Namespace) -> int:
    if args.explain is not None:
        from sim_ecu.design.explain import explain

        return explain(args.explain)
    from sim_ecu.commands.run_design import run
    from wrcd.errors import InputError

    if args.output is None:
        raise InputError("is missing", key="-o", hint="name the file to make, or ask for --explain")
    for key in ("budget", "jobs"):
        if getattr(args, key) < 1:
            raise InputError(f"takes a whole number from 1 on, not {getattr(args, key)}", key=f"--{key}")
    budget = args.budget if args.search else None
    return run(args.config, args.output, args.baselines, args.form, budget, args.jobs)


def _contact(args: argparse.Namespace) -> int:
    from sim_ecu.score.contact import run

    return run(args.cases, args.k_a, args.k_s)


def _score(args: argparse.Namespace) -> int:
    from sim_ecu.commands.run_score import run
    from wrcd.errors import InputError

    if args.jobs < 1:
        raise InputError(f"takes a whole number from 1 on, not {args.jobs}", key="--jobs")
    return run(args.suite, args.quick, args.jobs, args.design, args.baselines, args.beside, args.json, args.html)


def _figures(args: argparse.Namespace) -> int:
    from sim_ecu.score.figures import run

    return run(args.output, args.design, args.paper)


def _verify(args: argparse.Namespace) -> int:
    from sim_ecu.design.verify import run

    return run(args.log, args.config, args.fuzzy_every)


def _demo(args: argparse.Namespace) -> int:
    from sim_ecu.play.demo import run

    return run(args.interface, args.channel, args.scenario, args.output, args.config)


_COMMANDS = {
    "list": _list, "play": _play, "inject": _inject, "faults": _faults, "design": _design, "verify": _verify,
    "demo": _demo, "contact": _contact, "score": _score, "figures": _figures,
}  # fmt: skip
