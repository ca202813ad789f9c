"""The command `wrcd why`."""

from argparse import ArgumentParser, Namespace

from wrcd.cli.arguments import add_axle, add_log, read_story, seconds
from wrcd.cli.program import Subcommand


def _add(p: ArgumentParser) -> None:
    add_log(p)
    p.add_argument(
        "seconds",
        type=seconds,
        metavar="SECONDS",
        nargs="?",
        help="after the log's first frame; or since 1970, as in the log (default: where the estimate first fell)",
    )
    add_axle(p)
    p.add_argument("--json", action="store_true", help="for a program")


def _run(args: Namespace) -> int:
    import json

    from wrcd.errors import InputError, Status
    from wrcd.logs.why import answer, first_fall, moment, record

    story = read_story(args)
    time_us = first_fall(story) if args.seconds is None else moment(story, args.seconds)
    if not story.axles:
        raise InputError(
            "has no frame of wrcd, and too few inputs to estimate from", file=args.log, hint="give a longer log"
        )
    numbers = args.axle or [a.number for a in story.axles]
    if args.json:
        axles = [record(story, number, time_us) for number in numbers]
        out = {"log": str(story.log), "source": story.source, "begin_s": story.begin_us / 1e6, "axles": axles}
        print(json.dumps(out, indent=2, ensure_ascii=False))
    else:
        print("\n\n".join("\n".join(answer(story, number, time_us)) for number in numbers))
    return Status.DONE if story.whole else Status.STOPPED


COMMAND = Subcommand(
    "why",
    "why adhesion and Validity were what they were at a moment of a log",
    (
        ("wrcd why ride.log", "where the estimate first fell, of every axle"),
        ("wrcd why ride.log 9.3 --axle 2", "axle 2 alone; the rig's truth, if the log has it, beside it"),
    ),
    _add,
    _run,
    retried=False,
)
