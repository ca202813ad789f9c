"""The command `wrcd plot`."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from wrcd.cli.arguments import add_axle, add_log, read_story, seconds
from wrcd.cli.program import Subcommand


def _add(p: ArgumentParser) -> None:
    add_log(p)
    p.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT.png", help="write it there; .svg and .pdf likewise"
    )
    p.add_argument(
        "--from", dest="begin", type=seconds, metavar="S",
        help="draw from then on: seconds after the first frame, or since 1970 as in the log",
    )  # fmt: skip
    p.add_argument("--to", dest="end", type=seconds, metavar="S", help="… and up to then")
    p.add_argument("--relative", action="store_true", help="times are always after the log's first frame")
    add_axle(p)
    p.add_argument("--force", action="store_true", help="overwrite a file that is there")


def _run(args: Namespace) -> int:
    from wrcd.errors import InputError, Status, need
    from wrcd.logs.replay_outputs import check_output

    suffixes = (".png", ".svg", ".pdf")
    if args.output.suffix.lower() not in suffixes:
        raise InputError(f"takes {', '.join(suffixes)}", file=args.output, key="-o", hint="give one of these suffixes")
    need(("matplotlib",), "report")
    check_output(args.output, (args.log, args.config, *args.dbc))
    if args.output.exists() and not args.force:
        raise InputError("is there", file=args.output, key="-o", hint="another name, or --force")
    if args.begin is not None and args.end is not None and args.begin >= args.end:
        raise InputError(f"{args.end:g} is not behind --from {args.begin:g}", key="--to")
    from wrcd.logs.why import moment
    from wrcd.report.picture import draw

    story = read_story(args)
    begin_us, end_us = story.begin_us, story.end_us
    if args.begin is not None:
        begin_us = moment(story, args.begin, key="--from", relative=args.relative)
    if args.end is not None:
        end_us = min(moment(story, args.end, key="--to", relative=args.relative, behind=True), story.end_us)
    if not story.axles:
        raise InputError(
            "has no frame of wrcd, and too few inputs to estimate from", file=args.log, hint="give a longer log"
        )
    axles = [story.axle(number) for number in args.axle] or list(story.axles)
    try:
        draw(story, axles, begin_us, end_us, args.output)
    except OSError as e:
        raise InputError(f"cannot be written: {e.strerror}", file=args.output, key="-o") from None
    return Status.DONE if story.whole else Status.STOPPED


COMMAND = Subcommand(
    "plot",
    "draw adhesion, Validity, contact and residuals of a log as one picture",
    (
        ("wrcd plot ride.log -o ride.png", "all of it"),
        (
            "wrcd plot ride.log -o fall.svg --from 5 --to 20 --axle 1 --dbc sim_ecu.dbc",
            "15 s of one axle, with the rig's truth",
        ),
    ),
    _add,
    _run,
    retried=False,
)
