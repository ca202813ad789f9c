"""What each exit status of each command means: docs/reference/exit-codes.md is made from it."""

from wrcd.errors import Status

_BAD = "bad input: file, line, key, reason and what to do; or a package of the extra is missing"
_FILE = "a configuration, a DBC or a design cannot be opened: it may be there on the next try"
_BUS = "the bus or a file cannot be opened, or the interface has gone: the unit tries again"
_HOLES = (
    "runs failed twice: the error names them; their suites are left out of the tables; or with "
    "`--fail-on missed`, a goal is missed"
)
_UNJUDGED = "or, with `--fail-on`, no goal could be judged"
_PRINTED = "the tables are printed, whatever the goals' verdicts; with `--fail-on missed`, no goal is missed"
_STOPPED = {Status.INTERRUPTED: "Ctrl-C"}
_MADE = {Status.BAD_INPUT: _BAD, Status.NOT_THERE: _FILE, **_STOPPED}

STATUSES: dict[str, dict[Status, str]] = {
    "list": {Status.DONE: "done"},
    "play": {
        Status.DONE: "the scenario is over, or SIGTERM or Ctrl-C came",
        Status.BAD_INPUT: _BAD,
        Status.NOT_THERE: _BUS,
        Status.INTERRUPTED: "Ctrl-C before it played, or with `--fast`",
    },
    "inject": {
        Status.DONE: "the scenario is over, or SIGTERM or Ctrl-C came",
        Status.BAD_INPUT: _BAD,
        Status.NOT_THERE: _BUS,
        Status.INTERRUPTED: "Ctrl-C before it played, or with `--fast`",
    },
    "drive": {
        Status.DONE: "the scenario is over",
        Status.STOPPED: "SIGTERM or Ctrl-C came before it was over: the figures are of what was driven",
        Status.BAD_INPUT: _BAD,
        Status.NOT_THERE: "the bus or a file cannot be opened",
        Status.INTERRUPTED: "Ctrl-C before it drove",
    },
    "control": {
        Status.DONE: "SIGTERM or Ctrl-C came, or the time of `--for` is over",
        Status.BAD_INPUT: _BAD,
        Status.NOT_THERE: "the bus or a file cannot be opened",
        Status.INTERRUPTED: "Ctrl-C before it controlled",
    },
    "faults": {
        Status.DONE: "every row did what it must",
        Status.STOPPED: "a row failed: the table says which",
        Status.BAD_INPUT: _BAD,
        **_STOPPED,
    },
    "design": {Status.DONE: "the file is made", **_MADE},
    "tune": {
        Status.DONE: "the design beats or equals the one to reach; or with `--played 0`, the brief is written",
        Status.STOPPED: "it does not reach it, or the runs cannot tell: it is written all the same, and the table says "
        "what differs",
        **_MADE,
        Status.INTERRUPTED: "Ctrl-C: the same command goes on from there",
    },
    "contact": {Status.DONE: "done", Status.BAD_INPUT: _BAD, **_STOPPED},
    "score": {
        Status.DONE: _PRINTED,
        Status.STOPPED: _HOLES,
        **_MADE,
        Status.BAD_INPUT: f"{_BAD}; {_UNJUDGED}",
    },
    "loop": {
        Status.DONE: _PRINTED,
        Status.STOPPED: _HOLES,
        Status.BAD_INPUT: f"{_BAD}; {_UNJUDGED}",
        **_STOPPED,
    },
    "campaign": {
        Status.DONE: "every job is done",
        Status.STOPPED: "jobs failed, took too long or died: their rows say why; or the workers are lost or have other "
        "code, or the disk is full: the same command goes on from there",
        Status.BAD_INPUT: _BAD,
        Status.INTERRUPTED: "Ctrl-C or SIGTERM: the same command goes on from there",
    },
    "compare": {
        Status.DONE: "the tables are printed, whatever the verdicts",
        Status.STOPPED: "with `--fail-on`: a figure is worse, or differs",
        Status.BAD_INPUT: f"{_BAD}; or, with `--fail-on`, nothing that differs could be judged",
        **_STOPPED,
    },
    "figures": {Status.DONE: "the figures are drawn, whatever they show", **_MADE},
    "fmu": {
        Status.DONE: "the FMU is made",
        Status.BAD_INPUT: _BAD,
        Status.NOT_THERE: "the scenario's file cannot be opened: it may be there on the next try",
        **_STOPPED,
    },
    "verify": {
        Status.DONE: "the engines agree",
        Status.STOPPED: "they differ by more than they may",
        Status.BAD_INPUT: f"{_BAD}; or the log has nothing to compare",
        Status.NOT_THERE: _FILE,
        **_STOPPED,
    },
    "demo": {
        Status.DONE: "valid estimates were seen",
        Status.STOPPED: "no valid estimate was seen",
        Status.BAD_INPUT: _BAD,
        Status.NOT_THERE: _BUS,
        **_STOPPED,
    },
    "completion": {Status.DONE: "the script is printed"},
}
