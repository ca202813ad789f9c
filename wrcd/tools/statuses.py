"""What each exit status of each command means: docs/reference/exit-codes.md is made from it."""

from wrcd.errors import Status

_BAD = "bad input: file, line, key, reason and what to do"
_BUS = "the bus or a file cannot be opened: it may be there on the next try"
_FILE = "a configuration, a DBC or a design cannot be opened: it may be there on the next try"

STATUSES: dict[str, dict[Status, str]] = {
    "run": {
        Status.DONE: "SIGTERM or Ctrl-C came: the last frames said NotAvailable, the last dump is written",
        Status.STOPPED: "a mistake in the program: a traceback; the unit starts it again",
        Status.BAD_INPUT: "bad configuration, DBC or design: file, line, key, reason; the unit does not try again",
        Status.NOT_THERE: "the bus or a file cannot be opened, after `--wait` at the latest; the unit tries again",
        Status.INTERRUPTED: "Ctrl-C before it ran",
    },
    "reload": {
        Status.DONE: "the file holds: limits were taken over, or nothing has changed; what needs a restart is named",
        Status.STOPPED: "nothing was taken over: a mistake in the file, every change needs a restart, or no answer",
        Status.BAD_INPUT: "the process is no `wrcd run`, runs on a terminal, or is another user's",
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
        Status.DONE: "the configuration can be run; with `--speed`: measured; of a log or a bus: nothing stops Valid",
        Status.STOPPED: "with `--speed`: an axle gave no estimate; of a log or a bus: something would stop Valid",
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
        Status.DONE: "the page is written",
        Status.STOPPED: "the log is cut or damaged: the page is of what could be read, and says so",
        Status.BAD_INPUT: f"{_BAD}: no usable log, a file to write that is no report, no extra report",
        Status.INTERRUPTED: "Ctrl-C",
    },
    "plot": {
        Status.DONE: "the picture is written",
        Status.STOPPED: "the log is cut or damaged: the picture is of what could be read",
        Status.BAD_INPUT: f"{_BAD}: no usable log, a time outside of it, a file that is there, no extra report",
        Status.INTERRUPTED: "Ctrl-C",
    },
    "why": {
        Status.DONE: "answered",
        Status.STOPPED: "the log is cut or damaged: answered from what could be read",
        Status.BAD_INPUT: f"{_BAD}: no usable log, a time outside of it, an axle that it has not",
        Status.INTERRUPTED: "Ctrl-C",
    },
    "install": {
        Status.DONE: "installed, or with `--dry-run` looked at; the output says what changed and what was kept",
        Status.STOPPED: "not all of it is installed: a file, or systemctl, failed on the way; install again; or with "
        "`--restart` a unit could not be restarted",
        Status.BAD_INPUT: "nothing was changed: no root, no systemd, a program that units cannot start, or a "
        "configuration that does not hold with this version",
    },
    "uninstall": {
        Status.DONE: "removed, or with `--dry-run` looked at; the output says what was kept",
        Status.STOPPED: "not all of it is removed: a file, or systemctl, failed on the way; uninstall again",
        Status.BAD_INPUT: "nothing was removed: no root, no systemd, or nothing that `wrcd install` has installed",
    },
    "completion": {Status.DONE: "the script is printed"},
}
