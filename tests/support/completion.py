"""bash and zsh completion of both programs, made from their parsers: wrcd/data/completion.

python -m tests.support.completion     writes them again
"""

from collections.abc import Callable

from tests.support.completion_bash import bash
from tests.support.completion_words import program
from tests.support.completion_zsh import zsh
from wrcd import resources

MAKERS: dict[str, Callable[[], str]] = {
    "wrcd.bash": lambda: bash(program("wrcd")),
    "_wrcd": lambda: zsh(program("wrcd")),
    "sim-ecu.bash": lambda: bash(program("sim-ecu")),
    "_sim-ecu": lambda: zsh(program("sim-ecu")),
}


if __name__ == "__main__":
    resources.COMPLETION.mkdir(exist_ok=True)
    for file, make in MAKERS.items():
        (resources.COMPLETION / file).write_text(make(), encoding="utf-8")
