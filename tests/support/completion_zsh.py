"""The zsh script: _arguments of the program, then of its command."""

from collections.abc import Sequence

from tests.support.completion_words import Argument, Values, Words

HEAD = r"""#compdef @program@
# zsh completion of @program@, made from its parser
# Print it: @program@ completion zsh. As _@program@ in a folder of $fpath, or: source <(@program@ completion zsh)

# CAN interfaces of this computer
@name@_channels() {
    local file
    local -a names
    for file in ${@name@_net:-/sys/class/net}/*/type(N); do
        [[ $(<$file) == 280 ]] && names+=(${file:h:t})
    done
    _wanted channels expl channel compadd -a names
}

@name@() {
    local curcontext=$curcontext state state_descr line expl ret=1
    typeset -A opt_args
    local -a commands
    commands=(
@commands@
    )
    _arguments -C \
@options@
        '1: :->command' \
        '*:: :->argument' && ret=0
    case $state in
    command)
        _describe -t commands command commands && ret=0
        ;;
    argument)
        curcontext=${curcontext%:*:*}:@program@-$words[1]:
        case $words[1] in
"""
TAIL = """        esac
        ;;
    esac
    return ret
}

if [[ $funcstack[1] == _@program@ ]]; then
    @name@ "$@"
else
    compdef @name@ @program@
fi
"""


def zsh(words: Sequence[Words]) -> str:
    """The script of a program. words: the program itself, then its commands."""
    whole, *commands = words
    listed = "\n".join(f"        {_quoted(f'{c.name}:{_colons(c.help)}')}" for c in commands)
    options = "\n".join(f"        {_spec(a)} \\" for a in whole.options)
    head = HEAD.replace("@commands@", listed).replace("@options@", options)
    body = "".join(_command(c) for c in commands)
    # the function is not named as its file is, or one that is autoloaded would be defined twice
    name = f"__{whole.name.replace('-', '_')}"
    return (head + body + TAIL).replace("@name@", name).replace("@program@", whole.name)


def _command(c: Words) -> str:
    specs = " \\\n".join(f"                {_spec(a)}" for a in c.arguments)
    return f"        {c.name})\n            _arguments \\\n{specs} && ret=0\n            ;;\n"


def _spec(a: Argument) -> str:
    value = f"{'::' if a.optional else ':'}{_colons(a.label)}:{_action(a.values)}"
    each = "*" if a.again else ""
    if not a.names:
        return _quoted(each + value)
    others = "" if a.again else f"({' '.join(a.names)})"
    if a.names[0] == "-h":
        others = "(- : *)"
    end = f"[{_bracketed(a.help)}]" + (value if a.takes else "")
    names = [n + ("=" if a.takes and n.startswith("--") else "+" if a.takes else "") for n in a.names]
    if len(names) == 1:
        return _quoted(f"{others}{each}{names[0]}{end}")
    return f"{_quoted(others + each)}{{{','.join(names)}}}{_quoted(end)}"


def _action(v: Values) -> str:
    parts = []
    if v.words:
        listed = _colons(" ".join(v.words))
        parts.append(f"compadd -S '' - {listed}" if v.prefixes else f"({listed})")
    if v.channels:
        parts.append("@name@_channels")
    if v.folders:
        parts.append("_files -/")
    if v.suffixes is not None:
        globs = " ".join(f"*{s}(-.)" for s in v.suffixes)
        parts.append(f'_files -g "{globs}"' if globs else "_files")
    if len(parts) > 1:  # words and files
        words = f"compadd - {' '.join(v.words)}"
        return "{ " + "; ".join([words, *parts[1:]]) + " }"
    return parts[0] if parts else " "


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


def _colons(text: str) -> str:
    return text.replace("\\", "\\\\").replace(":", "\\:")


def _bracketed(text: str) -> str:
    return _colons(text).replace("[", "\\[").replace("]", "\\]")
