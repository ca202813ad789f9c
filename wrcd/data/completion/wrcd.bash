# bash completion of wrcd, made from its parser
# Print it: wrcd completion bash. For one shell: source <(wrcd completion bash)

_wrcd_words() {
    mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -W "$1" -- "$cur")
}

# Files that end in one of the suffixes, and folders. Where there is none, and for a word in quotes, readline looks.
_wrcd_files() {
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

_wrcd_folders() {
    mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -d -- "$cur")
    compopt -o filenames 2> /dev/null
}

# CAN interfaces of this computer
_wrcd_channels() {
    local file names=
    for file in "${_wrcd_net:-/sys/class/net}"/*/type; do
        [[ -r $file && $(< "$file") == 280 ]] || continue
        file=${file%/type}
        names+=" ${file##*/}"
    done
    _wrcd_words "$names"
}

# a number or a text: no names of files instead
_wrcd_nothing() {
    compopt +o default 2> /dev/null
}

_wrcd() {
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
            run:--config | run:-i | run:--interface | run:-c | \
            run:--channel | run:--wait | check:--config | check:--log | \
            check:--live | check:-i | check:--interface | check:-c | \
            check:--channel | dump:-i | dump:--interface | dump:-c | \
            dump:--channel | dump:-n | dump:--count | dump:--dbc | \
            dump:--config | monitor:-i | monitor:--interface | monitor:-c | \
            monitor:--channel | monitor:--config | monitor:--dbc | monitor:--bit-rate | \
            replay:--config | replay:-o | replay:--output | replay:--csv | \
            replay:--from | replay:--to | replay:--axle | replay:--channel | \
            replay:--events | replay:--mf4 | replay:--mcap | replay:--jobs | \
            report:--config | report:--dbc | report:--channel | report:-o | \
            report:--output | report:--against | report:--bit-rate | plot:--config | \
            plot:--dbc | plot:--channel | plot:-o | plot:--output | \
            plot:--from | plot:--to | plot:--axle | why:--config | \
            why:--dbc | why:--channel | why:--axle | init:-o | \
            init:--output | kit:-o | kit:--output | kit:--config | \
            install:--prefix | install:--with | install:--without | install:--program | \
            uninstall:--prefix)
                [[ ${COMP_WORDS[i + 1]-} != = ]] || ((i++))
                ((i++))
                ;;
            esac
        else
            ((position++))
        fi
    done
    case $command in
    '')
        options='-h --help --version'
        [[ $cur == -* ]] || _wrcd_words 'run reload check dump monitor replay report plot why init lint kit install uninstall completion'
        ;;
    run)
        options='-h --help --config -i --interface -c --channel --wait --lock-memory'
        case $prev in
        --config) _wrcd_files .toml; return ;;
        -i | --interface) _wrcd_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _wrcd_channels; return ;;
        --wait) _wrcd_nothing; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -* ]] || _wrcd_nothing
        ;;
    reload)
        options='-h --help -q --quiet'
        case $prev in
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_nothing ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    check)
        options='-h --help --config --speed --log --live -i --interface -c --channel'
        case $prev in
        --config) _wrcd_files .toml; return ;;
        --log) _wrcd_files .log .gz .asc .blf .trc .csv .db .mf4; return ;;
        --live) _wrcd_nothing; return ;;
        -i | --interface) _wrcd_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _wrcd_channels; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -* ]] || _wrcd_nothing
        ;;
    dump)
        options='-h --help -i --interface -c --channel -n --count --dbc --config'
        case $prev in
        -i | --interface) _wrcd_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _wrcd_channels; return ;;
        -n | --count) _wrcd_nothing; return ;;
        --dbc) _wrcd_files .dbc; return ;;
        --config) _wrcd_files .toml; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_files .log .gz .asc .blf .trc .csv .db .mf4 ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    monitor)
        options='-h --help -i --interface -c --channel --config --dbc --bit-rate'
        case $prev in
        -i | --interface) _wrcd_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _wrcd_channels; return ;;
        --config) _wrcd_files .toml; return ;;
        --dbc) _wrcd_files .dbc; return ;;
        --bit-rate) _wrcd_nothing; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_files .log .gz .asc .blf .trc .csv .db .mf4 ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    replay)
        options='-h --help --config -o --output --csv --from --to --relative --axle --channel --events --mf4 --mcap --explain --jobs'
        case $prev in
        --config) _wrcd_files .toml; return ;;
        -o | --output) _wrcd_files .log; return ;;
        --csv) _wrcd_files .csv; return ;;
        --from) _wrcd_nothing; return ;;
        --to) _wrcd_nothing; return ;;
        --axle) _wrcd_nothing; return ;;
        --channel) _wrcd_channels; return ;;
        --events) _wrcd_files .csv; return ;;
        --mf4) _wrcd_files .mf4; return ;;
        --mcap) _wrcd_files .mcap; return ;;
        --jobs) _wrcd_nothing; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        *) _wrcd_files .log .gz .asc .blf .trc .csv .db .mf4 ;;
        esac
        ;;
    report)
        options='-h --help --config --dbc --channel --replay -o --output --against --bit-rate --force'
        case $prev in
        --config) _wrcd_files .toml; return ;;
        --dbc) _wrcd_files .dbc; return ;;
        --channel) _wrcd_channels; return ;;
        -o | --output) _wrcd_files .html; return ;;
        --against) _wrcd_files ''; return ;;
        --bit-rate) _wrcd_nothing; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_files .log .gz .asc .blf .trc .csv .db .mf4 ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    plot)
        options='-h --help --config --dbc --channel --replay -o --output --from --to --relative --axle --force'
        case $prev in
        --config) _wrcd_files .toml; return ;;
        --dbc) _wrcd_files .dbc; return ;;
        --channel) _wrcd_channels; return ;;
        -o | --output) _wrcd_files .png; return ;;
        --from) _wrcd_nothing; return ;;
        --to) _wrcd_nothing; return ;;
        --axle) _wrcd_nothing; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_files .log .gz .asc .blf .trc .csv .db .mf4 ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    why)
        options='-h --help --config --dbc --channel --replay --axle --json'
        case $prev in
        --config) _wrcd_files .toml; return ;;
        --dbc) _wrcd_files .dbc; return ;;
        --channel) _wrcd_channels; return ;;
        --axle) _wrcd_nothing; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_files .log .gz .asc .blf .trc .csv .db .mf4 ;;
        1) _wrcd_nothing ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    init)
        options='-h --help -o --output --force'
        case $prev in
        -o | --output) _wrcd_files .toml; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_files .dbc ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    lint)
        options='-h --help --json'
        case $prev in
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_files .dbc ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    kit)
        options='-h --help -o --output --config --force'
        case $prev in
        -o | --output) _wrcd_folders; return ;;
        --config) _wrcd_files .toml; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -* ]] || _wrcd_nothing
        ;;
    install)
        options='-h --help --prefix --dry-run --with --without --restart --force --program'
        case $prev in
        --prefix) _wrcd_folders; return ;;
        --with) _wrcd_words 'can0 vcan0 realtime rig'; return ;;
        --without) _wrcd_words 'can0 vcan0 realtime rig'; return ;;
        --program) _wrcd_nothing; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -* ]] || _wrcd_nothing
        ;;
    uninstall)
        options='-h --help --prefix --dry-run --purge'
        case $prev in
        --prefix) _wrcd_folders; return ;;
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -* ]] || _wrcd_nothing
        ;;
    completion)
        options='-h --help'
        case $prev in
        :) _wrcd_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _wrcd_words 'bash zsh' ;;
        *) _wrcd_nothing ;;
        esac
        ;;
    *) return ;;
    esac
    if [[ $cur == -* ]]; then
        _wrcd_words "$options"
    fi
}

complete -o default -F _wrcd wrcd
