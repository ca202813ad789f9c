"""bash and zsh completion of both programs, made from their parsers by shtab: wrcd/data/completion.

python -m tests.support.completion     writes them again
"""

import argparse
import re
from pathlib import Path

import shtab

from sim_ecu.cli.main import SIM_ECU
from sim_ecu.play.faults import KINDS
from sim_ecu.play.scenario import packaged
from sim_ecu.play.vehicles import packaged_vehicles
from wrcd import resources
from wrcd.cli.completion import FILES
from wrcd.cli.main import WRCD
from wrcd.cli.program import Program
from wrcd.config import declared
from wrcd.config.packaged_designs import packaged_designs

PROGRAMS = (WRCD, SIM_ECU)
LOGS = "log gz asc blf trc csv db mf4"
SUFFIXES = {"config": "toml", "dbc": "dbc"}  # by the argument's name
# what shtab has no word for: words and files of some kind, and the CAN interfaces of this computer
PREAMBLE = {
    "bash": r"""_wrcd_files() {
    local suffix
    for suffix in $1; do compgen -f -X "!*.$suffix" -- "$2"; done
    compgen -d -- "$2"
}
_wrcd_channels() {
    local file
    for file in "${_wrcd_net:-/sys/class/net}"/*/type; do
        [[ -r $file && $(< "$file") == 280 ]] || continue
        file=${file%/type}
        compgen -W "${file##*/}" -- "$1"
    done
}
""",
    "zsh": r"""_wrcd_channels() {
    local file
    local -a names
    for file in ${_wrcd_net:-/sys/class/net}/*/type(N); do
        [[ $(<$file) == 280 ]] && names+=(${file:h:t})
    done
    _wanted channels expl channel compadd -a names
}
""",
}


def script(program: Program, shell: str) -> str:
    """Return the script of a program for a shell."""
    parser, functions = program.parser(), dict[str, str]()
    for p in (parser, *_subparsers(parser).choices.values()):
        for action in p._actions:
            if not action.choices and action.nargs != 0:
                _complete(action, functions)
    preamble = PREAMBLE[shell] + "".join(functions.values()) * (shell == "bash")
    text = shtab.complete(parser, shell=shell, preamble={shell: preamble})  # type: ignore[arg-type]  # it says str
    return "\n".join(line.rstrip() for line in text.rstrip().splitlines()) + "\n"


def _subparsers(parser: argparse.ArgumentParser) -> "argparse._SubParsersAction[argparse.ArgumentParser]":
    return next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))


def _complete(action: argparse.Action, functions: dict[str, str]) -> None:
    """Have an argument completed by what its name, type and metavar say of its values; nothing for other text."""
    metavar, suffixes = str(action.metavar or ""), ""
    words: list[str] = []
    if action.dest == "interface":
        words = list(declared.INTERFACES)
    elif action.dest == "channel":
        action.complete = {"bash": "_wrcd_channels", "zsh": "_wrcd_channels"}  # type: ignore[attr-defined]  # shtab's own
        return
    elif action.dest == "fault":
        words = [f"{kind}:" for kind in KINDS]
    elif action.dest == "scenario":
        words, suffixes = packaged(), "toml"
    elif metavar == "DIR":
        action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]  # shtab's own
        return
    elif metavar == "DESIGN":
        words, suffixes = packaged_designs(), "json"
    elif action.type is not Path:
        return
    elif metavar == "RIG.toml":
        words, suffixes = packaged_vehicles(), "toml"
    else:
        named = re.search(r"\.(\w+)$", metavar)
        suffixes = SUFFIXES.get(action.dest) or (LOGS if metavar == "LOG" else named[1] if named else "*")
    # shtab has readline take for files what a function gives whose name says so
    kind = "file" if suffixes else "words"
    name = f"_wrcd_{kind}_" + re.sub(r"\W", "_", "_".join((*words[:1], suffixes.replace("*", "any"))))
    lines = [f"    compgen -W '{' '.join(words)}' -- \"$1\"\n"] if words else []
    lines += [f"    _wrcd_files '{suffixes}' \"$1\"\n"] if suffixes and suffixes != "*" else []
    lines += ['    compgen -f -- "$1"\n'] if suffixes == "*" else []
    functions[name] = f"{name}() {{\n{''.join(lines)}}}\n"
    zsh = [f"compadd -S '' - {' '.join(words)}"] if words else []
    zsh += ["_files" if suffixes == "*" else f"_files -g '*.({'|'.join(suffixes.split())})(-.)'"] if suffixes else []
    action.complete = {"bash": name, "zsh": f"{{ {'; '.join(zsh)} }}"}  # type: ignore[attr-defined]  # shtab's own


if __name__ == "__main__":
    resources.COMPLETION.mkdir(exist_ok=True)
    for program in PROGRAMS:
        for shell, name in FILES.items():
            (resources.COMPLETION / name.format(program.name)).write_text(script(program, shell), encoding="utf-8")
