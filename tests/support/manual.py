"""The manual pages: wrcd/data/man, made by Sphinx from the Markdown that the pages of the documentation quote.

python -m tests.support.manual     writes them again
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from tests.support.pages import PROGRAMS, ROOT, configuration, messages, options
from tests.support.pages import table as md_table
from tests.support.statuses import STATUSES
from wrcd import __version__, resources
from wrcd.cli.program import sentence
from wrcd.core.causes import Cause
from wrcd.errors import Status

DOES = {
    "wrcd": "available adhesion on the CAN bus, before the wheel slips",
    "sim-ecu": "the rig: nonlinear wheelsets on a CAN bus",
    "wrcd.toml": "configuration of wrcd",
    "wrcd-frames": "the CAN frames of wrcd",
}
PYTHON_CAN = """`CAN_INTERFACE`, `CAN_CHANNEL`, `CAN_BITRATE`, `CAN_CONFIG`
: python-can's settings of a bus, as its files ~/can.conf, /etc/can.conf, ~/.can and ~/.canrc have them. The tools take
  them where neither options nor the configuration name a bus. `wrcd run` never does.

`NO_COLOR`, `FORCE_COLOR`, `CLICOLOR_FORCE`, `TERM`
: No colours; colours in a pipe, too; `dumb`: no colours, and no line that is written anew.
"""
COMMANDS = {
    "wrcd": (
        """A daemon estimates the available adhesion of each axle from yaw rate, lateral acceleration, torque and speed
on the CAN bus, and sends it there fifty times a second. Tools check its configuration, decode what a bus carries, and
run the same estimator over logs. All accuracy is against simulation; nothing has run on a train.""",
        f"""## SIGNALS

`SIGTERM`, `SIGINT`
: The daemon sends its last frames, which say NotAvailable, writes a last dump, ends.

`SIGHUP`
: It reads its configuration again; on a terminal it ends.

`SIGUSR1`
: It writes a recorder's dump.

## ENVIRONMENT

{PYTHON_CAN}
`NOTIFY_SOCKET`, `WATCHDOG_USEC`
: systemd's: the daemon says when it is ready, and that it is alive.

`STATE_DIRECTORY`
: systemd's: where the recorder writes, if the configuration does not say.

## FILES

`/etc/wrcd/INTERFACE.env`
: Options of the unit `wrcd@INTERFACE`: `WRCD_OPTIONS=--config …`

`/etc/wrcd/INTERFACE.toml`
: Its configuration, by custom. See `wrcd.toml`(5).

## SEE ALSO

`sim-ecu`(1), `wrcd.toml`(5), `wrcd-frames`(7), `candump`(1), `systemctl`(1)
""",
    ),
    "sim-ecu": (
        """Plays simulated wheelsets, with faults where they are asked for, onto a bus or into a log; makes the design
file of the estimator, and measures how good it is. It is not for a train.""",
        f"""## SIGNALS

`SIGTERM`, `SIGINT`
: Playing ends; what was played is said.

## ENVIRONMENT

{PYTHON_CAN}
`NUMBA_CACHE_DIR`
: Where the compiled wheelset is kept. Default: beside the program.

`MPLCONFIGDIR`
: The same for the fonts of the pictures.

## FILES

`/etc/wrcd/sim-ecu-INTERFACE.env`
: The scenario of the unit `sim-ecu@INTERFACE`.

## SEE ALSO

`wrcd`(1), `wrcd.toml`(5), `wrcd-frames`(7)
""",
    ),
}
TOML = """## DESCRIPTION

One TOML file, named by `--config`. Without one the packaged network with four axles holds. It is read strictly: an
unknown key, a wrong type or a value out of range is an error with file, line, key and a suggestion, and all mistakes
are said at once. Paths are relative to the file's folder. `wrcd check --config FILE` says what the file would run;
`wrcd init` proposes one for a DBC.

Keys with "Reload: yes" are taken over by SIGHUP; all others need a restart.

## KEYS

{tables}

`wheelset.…`
: Any key of the design's wheelset, `name` among them. What it states is compared with the design, and a design for
  another wheelset is refused. A configuration with a DBC of its own must have this table or `estimator.design`.

## A SIGNAL THAT IS READ

`yaw_rate = "Message.Signal"` is the short form. A table says what the DBC lacks or has otherwise:

{input}

## A MESSAGE THAT IS SENT

`adhesion = "WSP_Adhesion1"` is the short form: its signals have the names of `wrcd-frames`(7). A table gives others, by
those names in small letters: `mu_available = {{ signal = "Friction", not_available = 255 }}`.

{output}

## EXAMPLE

```toml
[bus]
channel = "can0"

[dbc]
file = "train.dbc"

[wheelset]
name = "multiple-unit"

[vehicle]
speed = "TCMS.Speed"

[[axle]]
number = 1
yaw_rate = {{ signal = "Bogie1.GyroZ", sign = -1, unit = "deg/s" }}
lateral_acceleration = "Bogie1.AccelY"
torque = {{ signal = "TCU1.Motor", at = "motor", gear_ratio = 4.6 }}
adhesion = "WSP_Adhesion1"
```

## SEE ALSO

`wrcd`(1), `wrcd-frames`(7)
"""
FRAMES = """## DESCRIPTION

The packaged network: classical CAN, standard ids, Intel byte order. A train's own DBC gives other names, ids, units and
words; see `wrcd.toml`(5). Every message is under AUTOSAR E2E Profile 11: the CRC in byte 0, the counter in the low
nibble of byte 1. A receiver takes a message for lost after three cycles.

## WHAT A CONSUMER DOES

`Valid`
: The estimate may be used, with its interval (Confidence).

`Degraded`
: There is an estimate. It must not be relied on: act as without one.

`NotAvailable`
: There is no estimate: act as without one.

A frame whose CRC or counter is wrong, or that is late, is NotAvailable.

## CAUSES

AdhesionDetail says why an axle is not Valid:

{causes}

## MESSAGES

{messages}

## SEE ALSO

`wrcd`(1), `wrcd.toml`(5), `candump`(1)
"""
NAMES = {"wrcd.1": "wrcd", "sim-ecu.1": "sim-ecu", "wrcd.toml.5": "wrcd.toml", "wrcd-frames.7": "wrcd-frames"}
CONF = """
project = author = "wrcd"
extensions = ["myst_parser"]
myst_enable_extensions = ["deflist"]
suppress_warnings = ["toc.not_included", "myst.header"]
version = release = {version!r}
today = {today!r}
root_doc = "wrcd"
man_pages = {pages!r}
"""


def definitions(lines: Iterable[str]) -> str:
    """Markdown whose tables are lists of definitions: what is last in a row first, the other columns by their names."""
    out: list[str] = []
    head: list[str] = []
    for line in lines:
        cells = [c.strip().replace("\\|", "|") for c in re.split(r"(?<!\\)\|", line)[1:-1]]
        if not line.startswith("|"):
            head = []
            out.append(line)
        elif not head:
            head = cells
        elif set(cells) != {"---"}:
            *others, what = [(h, c) for h, c in zip(head[1:], cells[1:], strict=True) if c and c != "–"] or [("", "")]
            facts = [sentence(what[1]), *(f"{h.capitalize()}: {c}." for h, c in others)]
            out += ["", cells[0], f": {' '.join(facts)}"]
    return "\n".join(out)


def commands(program: str) -> str:
    """wrcd(1) or sim-ecu(1)."""
    about, more = COMMANDS[program]
    own, *given = definitions(options(program)).replace("\n### ", "\n\0").split("\0")
    parts = [f"## DESCRIPTION\n\n{about}\n\n## OPTIONS\n{own}\n\n### {given[0]}\n\n## COMMANDS\n"]
    for command, part in zip(PROGRAMS[program].commands(), given[1:], strict=True):
        status = "\n".join(f"\n`{s:d}`\n: {sentence(text)}" for s, text in STATUSES[program][command.name].items())
        examples = [f"```sh\n{line}\n```\n\n{sentence(what)}\n" for line, what in command.examples]
        parts += [f"### {part}\n\n**Examples:**\n", *examples, f"**Exit status:**\n{status}\n"]
    parts.append(
        f"## EXIT STATUS\n\nA wrong option is {Status.BAD_INPUT:d}, with the usage; Ctrl-C is 130. A pipe that its "
        "reader has closed is no error.\n"
    )
    return "\n".join([*parts, more])


def toml() -> str:
    """wrcd.toml(5)."""
    return TOML.format(**{which: definitions(configuration(which)) for which in ("tables", "input", "output")})


def frames() -> str:
    """wrcd-frames(7)."""
    causes = md_table(("cause", "what"), [(f"`{c:d} {c.label}`", c.words) for c in Cause if c])
    return FRAMES.format(causes=definitions(causes), messages=definitions(messages()))


SOURCES: dict[str, Callable[[], str]] = {
    "wrcd": lambda: commands("wrcd"),
    "sim-ecu": lambda: commands("sim-ecu"),
    "wrcd.toml": toml,
    "wrcd-frames": frames,
}


def make(folder: Path) -> None:
    """Write the pages into a folder. Raises CalledProcessError with Sphinx's words for anything that it warns of."""
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.search(rf"^## {re.escape(__version__)} - (\S+)$", changes, re.MULTILINE)
    pages: list[tuple[object, ...]] = [(name, name, DOES[name], [], int(file[-1])) for file, name in NAMES.items()]
    with tempfile.TemporaryDirectory() as sources:
        conf = CONF.format(version=__version__, today=released[1] if released else "", pages=pages)
        Path(sources, "conf.py").write_text(conf, encoding="utf-8")
        for name, source in SOURCES.items():
            Path(sources, f"{name}.md").write_text(f"# {name}\n\n{source()}", encoding="utf-8")
        subprocess.run(
            [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "man", "-d", f"{sources}/.read", sources,
             str(folder)],
            timeout=120, check=True,
        )  # fmt: skip


if __name__ == "__main__":
    make(resources.MANUAL)
