"""The command `wrcd report`."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from wrcd.cli.arguments import add_bit_rate, add_log, check_bit_rate, read_story
from wrcd.cli.program import Subcommand

if TYPE_CHECKING:
    from wrcd.core.configuration import Config
    from wrcd.logs.story_records import Story

DEFAULT = Path("report.html")
MAX_SENTENCES = 12  # that are printed; the page has all


def _add(p: ArgumentParser) -> None:
    add_log(p)
    p.add_argument(
        "-o", "--output", type=Path, default=DEFAULT, metavar="REPORT.html",
        help="write it there (default: report.html); an earlier report is overwritten",
    )  # fmt: skip
    p.add_argument(
        "--against", type=Path, metavar="FILE",
        help="beside another log; or the same log estimated with another design (.json, or a packaged one's name) or "
        "configuration (.toml)",
    )  # fmt: skip
    add_bit_rate(p)
    p.add_argument("--force", action="store_true", help="overwrite a file that is no report")


def _run(args: Namespace) -> int:
    from wrcd.errors import InputError, Status, need
    from wrcd.logs.replay_outputs import check_output, check_overwrite

    check_bit_rate(args.bit_rate)
    need(("bokeh",), "report")
    check_output(args.output, (args.log, args.config, args.against, *args.dbc))
    if not args.force:
        check_overwrite(args.output, 'content="wrcd report"', "report of wrcd")
    from wrcd.config.config import load_config
    from wrcd.report.report_page import write

    config = load_config(args.config)
    against_config = _against_config(args, config)
    story = read_story(args, config)
    against = None if args.against is None else _against(args, config, against_config)
    try:
        write(story, against, args.output)
    except OSError as e:
        raise InputError(f"cannot be written: {e.strerror}", file=args.output, key="-o") from None
    _tell(story, against)
    print(f"{args.output}: {args.output.stat().st_size / 1e6:.1f} MB")
    return Status.DONE if story.whole else Status.STOPPED


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
        return read_story(Namespace(**{**vars(args), "log": args.against, "config": None}), config)
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
        ("wrcd report ride.log -o report.html", "of a log, with what wrcd said in it or would have said"),
        ("wrcd report ride.log --against other.design.json", "the same log estimated with another design beside it"),
    ),
    _add,
    _run,
    retried=False,
)
