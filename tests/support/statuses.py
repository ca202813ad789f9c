"""What each exit status of each command means: the page has them, and tests try each."""

from wrcd.errors import Status

_BAD = "bad input: file, line, key, reason and what to do"
_BUS = "the bus or a file cannot be opened: it may be there on the next try"
_FILE = "a configuration, a DBC or a design cannot be opened: it may be there on the next try"

_RIG_BAD = "bad input: file, line, key, reason and what to do; or a package of the extra is missing"
_RIG_BUS = "the bus or a file cannot be opened, or the interface has gone: the unit tries again"
_HOLES = (
    "runs failed twice: the error names them; their suites are left out of the tables; or with "
    "`--fail-on missed`, a goal is missed"
)
_UNJUDGED = "or, with `--fail-on`, no goal could be judged"
_PRINTED = "the tables are printed, whatever the goals' verdicts; with `--fail-on missed`, no goal is missed"
_STOPPED = {Status.INTERRUPTED: "Ctrl-C"}
_MADE = {Status.BAD_INPUT: _RIG_BAD, Status.NOT_THERE: _FILE, **_STOPPED}

WRCD: dict[str, dict[Status, str]] = {
    "run": {
        Status.DONE: "SIGTERM or Ctrl-C came: the last frames said NotAvailable, a dump that was due is written",
        Status.STOPPED: "a mistake in the program: a traceback; the unit starts it again",
        Status.BAD_INPUT: "bad configuration, DBC or design: file, line, key, reason; the unit does not try again",
        Status.NOT_THERE: "the bus or a file cannot be opened, after `--wait` at the latest; the unit tries again",
        Status.INTERRUPTED: "Ctrl-C before it ran",
    },
    "init": {
        Status.DONE: "the proposal is written; standard error says what is open and unsure",
        Status.BAD_INPUT: f"{_BAD}: no such DBC, or a file to write that is there already",
    },
    "lint": {
        Status.DONE: "nothing found",
        Status.STOPPED: "findings",
        Status.BAD_INPUT: "the file cannot be read as a DBC",
    },
    "kit": {
        Status.DONE: "the files are written; standard error says what the receiver cannot do",
        Status.BAD_INPUT: f"{_BAD}; or a file in the folder that is no kit's, or was edited",
        Status.NOT_THERE: _FILE,
    },
    "check": {
        Status.DONE: "the configuration can be run; of a log or a bus: nothing stops Valid",
        Status.STOPPED: "of a log or a bus: something would stop Valid",
        Status.BAD_INPUT: _BAD,
        Status.NOT_THERE: f"{_FILE}; with `--live` the bus, too; of a log or a bus: no frame fits the configuration",
    },
    "dump": {
        Status.DONE: "the log has ended, or `--count` is reached, or whoever read the output has closed it",
        Status.STOPPED: "the log is cut or damaged: what could be read is shown",
        Status.BAD_INPUT: _BAD,
        Status.NOT_THERE: _BUS,
        Status.INTERRUPTED: "Ctrl-C",
    },
    "monitor": {
        Status.DONE: "a key has ended it",
        Status.BAD_INPUT: f"{_BAD}; no terminal to draw on, or the extra `monitor` is missing",
        Status.NOT_THERE: _BUS,
        Status.INTERRUPTED: "Ctrl-C while a log is read",
    },
    "replay": {
        Status.DONE: "done",
        Status.STOPPED: "the log is cut or damaged: what could be read is written",
        Status.BAD_INPUT: f"{_BAD}; of several logs, any of them",
        Status.NOT_THERE: "no frame of the log fits the configuration",
        Status.INTERRUPTED: "Ctrl-C",
    },
    "report": {
        Status.DONE: "the page is written, or with `--plot` the picture",
        Status.STOPPED: "the log is cut or damaged: what is written is of what could be read, and the page says so",
        Status.BAD_INPUT: f"{_BAD}: no usable log, a time outside of it, a file that would be lost, no extra report",
        Status.INTERRUPTED: "Ctrl-C",
    },
    "why": {
        Status.DONE: "answered",
        Status.STOPPED: "the log is cut or damaged: answered from what could be read",
        Status.BAD_INPUT: f"{_BAD}: no usable log, a time outside of it, an axle that it has not",
        Status.INTERRUPTED: "Ctrl-C",
    },
}
RIG: dict[str, dict[Status, str]] = {
    "list": {Status.DONE: "done"},
    "play": {
        Status.DONE: "the scenario is over, or SIGTERM or Ctrl-C came",
        Status.BAD_INPUT: _RIG_BAD,
        Status.NOT_THERE: _RIG_BUS,
        Status.INTERRUPTED: "Ctrl-C before it played, or with `--fast`",
    },
    "drive": {
        Status.DONE: "the scenario is over",
        Status.STOPPED: "SIGTERM or Ctrl-C came before it was over: the figures are of what was driven",
        Status.BAD_INPUT: _RIG_BAD,
        Status.NOT_THERE: "the bus or a file cannot be opened",
        Status.INTERRUPTED: "Ctrl-C before it drove",
    },
    "control": {
        Status.DONE: "SIGTERM or Ctrl-C came, or the time of `--for` is over",
        Status.BAD_INPUT: _RIG_BAD,
        Status.NOT_THERE: "the bus or a file cannot be opened",
        Status.INTERRUPTED: "Ctrl-C before it controlled",
    },
    "design": {
        Status.DONE: "the file is made",
        Status.STOPPED: "jobs failed twice: the error names them",
        **_MADE,
    },
    "calibrate": {
        Status.DONE: "the vehicle's file is written",
        Status.STOPPED: "the logs do not tell the vehicle, and the reason is said",
        **_MADE,
    },
    "score": {
        Status.DONE: _PRINTED,
        Status.STOPPED: _HOLES,
        **_MADE,
        Status.BAD_INPUT: f"{_RIG_BAD}; {_UNJUDGED}",
    },
    "campaign": {
        Status.DONE: "every job is done",
        Status.STOPPED: "jobs failed, took too long or died: their rows say why; or the workers are lost or have other "
        "code, or the disk is full: the same command goes on from there",
        Status.BAD_INPUT: _RIG_BAD,
        Status.INTERRUPTED: "Ctrl-C or SIGTERM: the same command goes on from there",
    },
    "figures": {Status.DONE: "the figures are drawn", **_MADE},
    "demo": {
        Status.DONE: "valid estimates were seen",
        Status.STOPPED: "no valid estimate was seen",
        Status.BAD_INPUT: _RIG_BAD,
        Status.NOT_THERE: _RIG_BUS,
        **_STOPPED,
    },
}

STATUSES = {"wrcd": WRCD, "sim-ecu": RIG}
