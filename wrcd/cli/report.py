"""The command `wrcd report`."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from wrcd.cli.arguments import add_axle, add_bit_rate, add_log, check_bit_rate, read_story, seconds
from wrcd.cli.program import Subcommand

if TYPE_CHECKING:
    from wrcd.core.configuration import Config
    from wrcd.logs.story_records import Story

DEFAULT = Path("report.html")
MAX_SENTENCES = 12  # that are printed; the page has all


def _add(p: ArgumentParser) -> None:
    add_log(p)
    p.add_argument(
        "-o", "--output", type=Path, metavar="REPORT.html",
        help="write it there (default: report.html, or with --plot no page); an earlier report is overwritten",
    )  # fmt: skip
    p.add_argument(
        "--plot", type=Path, metavar="OUT.png",
        help="draw adhesion, Validity, contact and residuals as one picture; .svg and .pdf likewise",
    )  # fmt: skip
    p.add_argument(
        "--from", dest="begin", type=seconds, metavar="S",
        help="draw from then on: seconds after the first frame, or since 1970 as in the log",
    )  # fmt: skip
    p.add_argument("--to", dest="end", type=seconds, metavar="S", help="… and up to then")
    add_axle(p, "draw ")
    p.add_argument(
        "--against", type=Path, metavar="FILE",
        help="beside another log; or the same log estimated with another design (.json, or a packaged one's name) or "
        "configuration (.toml)",
    )  # fmt: skip
    add_bit_rate(p)
    p.add_argument("--force", action="store_true", help="overwrite a file that is no report, or a picture")


def _run(args: Namespace) -> int:
    from wrcd.errors import InputError, Status, need
    from wrcd.logs.replay_outputs import check_output, check_overwrite

    check_bit_rate(args.bit_rate)
    output = args.output or (DEFAULT if args.plot is None else None)
    given = (args.log, args.config, args.against, *args.dbc)
    if output is not None:
        need(("bokeh",), "report")
        check_output(output, given)
        if not args.force:
            check_overwrite(output, 'content="wrcd report"', "report of wrcd")
    _check_picture(args, (*given, output))
    from wrcd.config.config import load_config

    config = load_config(args.config)
    against_config = _against_config(args, config)
    story = read_story(args, config)
    against = None if args.against is None else _against(args, config, against_config)
    if args.plot is not None:
        _draw(args, story)
        print(f"picture  {args.plot}")
    if output is None:
        return Status.DONE if story.whole else Status.STOPPED
    from wrcd.report.report_page import write

    try:
        write(story, against, output)
    except OSError as e:
        raise InputError(f"cannot be written: {e.strerror}", file=output, key="-o") from None
    _tell(story, against)
    print(f"{output}: {output.stat().st_size / 1e6:.1f} MB")
    return Status.DONE if story.whole else Status.STOPPED


def _check_picture(args: Namespace, given: Sequence[Path | None]) -> None:
    """Before the work. Raises InputError."""
    from wrcd.errors import InputError, need
    from wrcd.logs.replay_outputs import check_output

    if args.plot is None:
        if args.begin is not None or args.end is not None or args.axle:
            raise InputError("belongs to a picture", key="--from, --to, --axle", hint="give --plot OUT.png")
        return
    if args.output is None and (args.against is not None or args.bit_rate is not None):
        raise InputError("belongs to a page", key="--against, --bit-rate", hint="give -o REPORT.html, too")
    need(("matplotlib",), "report")
    from wrcd.report.picture import SUFFIXES

    if args.plot.suffix.lower() not in SUFFIXES:
        raise InputError(f"takes {', '.join(SUFFIXES)}", file=args.plot, key="--plot", hint="give one of these")
    check_output(args.plot, given, "--plot")
    if args.plot.exists() and not args.force:
        raise InputError("is there", file=args.plot, key="--plot", hint="another name, or --force")
    if args.begin is not None and args.end is not None and args.begin >= args.end:
        raise InputError(f"{args.end:g} is not behind --from {args.begin:g}", key="--to")


def _draw(args: Namespace, story: "Story") -> None:
    """Of all axles, or of those that are asked for."""
    from wrcd.errors import InputError
    from wrcd.logs.why import moment
    from wrcd.report.picture import draw

    begin_us, end_us = story.begin_us, story.end_us
    if args.begin is not None:
        begin_us = moment(story, args.begin, key="--from")
    if args.end is not None:
        end_us = min(moment(story, args.end, key="--to", behind=True), story.end_us)
    if not story.axles:
        raise InputError(
            "has no frame of wrcd, and too few inputs to estimate from", file=args.log, hint="give a longer log"
        )
    try:
        draw(story, [story.axle(number) for number in args.axle] or list(story.axles), begin_us, end_us, args.plot)
    except OSError as e:
        raise InputError(f"cannot be written: {e.strerror}", file=args.plot, key="--plot") from None


def _against_config(args: Namespace, config: "Config") -> "Config | None":
    """The other design's or configuration's, None for another log. Before the work: it may have a mistake."""
    from wrcd.config.config import load_config
    from wrcd.config.packaged_designs import design_path, packaged_designs
    from wrcd.logs.log_comparison import with_design

    if args.against is None:
        return None
    suffix = args.against.suffix.lower()
    if suffix == ".json":
        return with_design(config, args.against)
    if str(args.against) in packaged_designs() and not args.against.exists():
        return with_design(config, design_path(str(args.against)))
    return load_config(args.against) if suffix == ".toml" else None


def _against(args: Namespace, config: "Config", other: "Config | None") -> "Story":
    """The story beside it: of another log, or of the same one estimated with what was given."""
    if other is None:
        return read_story(Namespace(**{**vars(args), "log": args.against, "config": None, "state": None}), config)
    return read_story(Namespace(**{**vars(args), "replay": True}), other)


def _tell(story: "Story", against: "Story | None") -> None:
    """Print the verdict's first sentences."""
    found = [*story.verdict]
    if against is not None:
        from wrcd.logs.log_comparison import sentences

        found = [*sentences(story, against), *found]
    for finding in found[:MAX_SENTENCES]:
        print(f"{finding.level}: {finding.text}")
    if len(found) > MAX_SENTENCES:
        print(f"and {len(found) - MAX_SENTENCES} more sentences in the report")


COMMAND = Subcommand(
    "report",
    "one page of a log: what happened, when, how long, how sure, and why",
    (
        ("wrcd report ride.log --against other.design.json", "the same log estimated with another design beside it"),
        ("wrcd report ride.log --plot fall.png --from 5 --to 20 --axle 1", "a picture of 15 s of one axle, no page"),
    ),
    _add,
    _run,
    retried=False,
)
