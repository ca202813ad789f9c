"""The bash script: one function that looks at the command, the word before and the positional's number."""

from collections.abc import Sequence

from tests.support.completion_words import Argument, Values, Words

# @name@ is the function's name, @program@ the program's. What is added to COMPREPLY begins with $cur of the caller.
HEAD = r"""# bash completion of @program@, made from its parser
# Print it: @program@ completion bash. For one shell: source <(@program@ completion bash)

@name@_words() {
    mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -W "$1" -- "$cur")
}

# Files that end in one of the suffixes, and folders. Where there is none, and for a word in quotes, readline looks.
@name@_files() {
    local name suffix
    [[ $cur == *[\"\'\\~]* ]] && return
    while IFS= read -r name; do
        if [[ -d $name ]]; then
            COMPREPLY+=("$name")
            continue
        fi
        for suffix; do
            if [[ $name == *"$suffix" ]]; then
                COMPREPLY+=("$name")
                break
            fi
        done
    done < <(compgen -f -- "$cur")
    compopt -o filenames 2> /dev/null
}

@name@_folders() {
    mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -d -- "$cur")
    compopt -o filenames 2> /dev/null
}

# CAN interfaces of this computer
@name@_channels() {
    local file names=
    for file in "${@name@_net:-/sys/class/net}"/*/type; do
        [[ -r $file && $(< "$file") == 280 ]] || continue
        file=${file%/type}
        names+=" ${file##*/}"
    done
    @name@_words "$names"
}

# a number or a text: no names of files instead
@name@_nothing() {
    compopt +o default 2> /dev/null
}

@name@() {
    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} command= options= position=0 i word
    COMPREPLY=()
    # --config=FILE and crc:at=3 are several words to bash
    if [[ $cur == = ]]; then
        cur=
    elif [[ $prev == = ]]; then
        prev=${COMP_WORDS[COMP_CWORD - 2]}
    fi
    for ((i = 1; i < COMP_CWORD; i++)); do
        word=${COMP_WORDS[i]}
        if [[ $word == [:=] ]]; then
            ((i++))
        elif [[ -z $command ]]; then
            [[ $word == -* ]] || command=$word
        elif [[ $word == -?* ]]; then
            case $command:$word in
@valued@)
                [[ ${COMP_WORDS[i + 1]-} != = ]] || ((i++))
                ((i++))
                ;;
            esac
        else
            ((position++))
        fi
    done
    case $command in
"""
TAIL = """    *) return ;;
    esac
    if [[ $cur == -* ]]; then
        @name@_words "$options"
    fi
}

complete -o default -F @name@ @program@
"""


def bash(words: Sequence[Words]) -> str:
    """The script of a program. words: the program itself, then its commands."""
    whole, *commands = words
    valued = [f"{c.name}:{name}" for c in commands for a in c.options if a.takes for name in a.names]
    lines = [f"            {' | '.join(valued[k : k + 4])} | \\" for k in range(0, len(valued), 4)]
    head = HEAD.replace("@valued@", "\n".join(lines).removesuffix(" | \\"))
    first = [
        "    '')",
        f"        options='{_names(whole.options)}'",
        f"        [[ $cur == -* ]] || @name@_words '{' '.join(c.name for c in commands)}'",
        "        ;;",
    ]
    body = "\n".join([*first, *(line for c in commands for line in _command(c))]) + "\n"
    name = whole.name.replace("-", "_")
    return (head + body + TAIL).replace("@name@", f"_{name}").replace("@program@", whole.name)


def _command(c: Words) -> list[str]:
    lines = [f"    {c.name})", f"        options='{_names(c.options)}'", "        case $prev in"]
    lines += [f"        {' | '.join(a.names)}) {_action(a.values)}; return ;;" for a in c.options if a.takes]
    lines += ["        :) @name@_nothing; return ;;", "        esac"]
    if c.positionals:
        lines += ["        [[ $cur == -?* ]] || case $position in"]
        for k, a in enumerate(c.positionals):
            lines.append(f"        {'*' if a.again else k}) {_action(a.values)} ;;")
        if not any(a.again for a in c.positionals):
            lines.append("        *) @name@_nothing ;;")
        lines.append("        esac")
    else:
        lines.append("        [[ $cur == -* ]] || @name@_nothing")
    return [*lines, "        ;;"]


def _names(options: Sequence[Argument]) -> str:
    return " ".join(name for a in options for name in a.names)


def _action(v: Values) -> str:
    parts = []
    if v.words:
        parts.append(f"@name@_words '{' '.join(v.words)}'")
    if v.prefixes:
        parts.append("compopt -o nospace 2> /dev/null")
    if v.channels:
        parts.append("@name@_channels")
    if v.folders:
        parts.append("@name@_folders")
    if v.suffixes is not None:
        parts.append(f"@name@_files {' '.join(v.suffixes) or repr('')}")
    return "; ".join(parts) or "@name@_nothing"
