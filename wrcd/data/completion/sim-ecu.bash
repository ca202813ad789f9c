# bash completion of sim-ecu, made from its parser
# Print it: sim-ecu completion bash. For one shell: source <(sim-ecu completion bash)

_sim_ecu_words() {
    mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -W "$1" -- "$cur")
}

# Files that end in one of the suffixes, and folders. Where there is none, and for a word in quotes, readline looks.
_sim_ecu_files() {
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

_sim_ecu_folders() {
    mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -d -- "$cur")
    compopt -o filenames 2> /dev/null
}

# CAN interfaces of this computer
_sim_ecu_channels() {
    local file names=
    for file in "${_sim_ecu_net:-/sys/class/net}"/*/type; do
        [[ -r $file && $(< "$file") == 280 ]] || continue
        file=${file%/type}
        names+=" ${file##*/}"
    done
    _sim_ecu_words "$names"
}

# a number or a text: no names of files instead
_sim_ecu_nothing() {
    compopt +o default 2> /dev/null
}

_sim_ecu() {
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
            play:-i | play:--interface | play:-c | play:--channel | \
            play:--log | play:--config | inject:-i | inject:--interface | \
            inject:-c | inject:--channel | inject:--log | inject:--config | \
            inject:--fault | drive:-i | drive:--interface | drive:-c | \
            drive:--channel | drive:--log | drive:--json | control:-i | \
            control:--interface | control:-c | control:--channel | control:--config | \
            control:--scenario | control:--for | design:--config | design:-o | \
            design:--output | design:--form | design:--budget | design:--jobs | \
            design:--baselines | design:--explain | contact:--k-a | contact:--k-s | \
            tune:--config | tune:-o | tune:--output | tune:--form | \
            tune:--over | tune:--budget | tune:--played | tune:--seed | \
            tune:--jobs | tune:--against | score:--suite | score:--jobs | \
            score:--design | score:--baselines | score:--beside | score:--fail-on | \
            score:--json | score:--html | figures:-o | figures:--output | \
            figures:--design | figures:--paper | loop:--suite | loop:--only | \
            loop:--seeds | loop:--jobs | loop:--fail-on | loop:--json | \
            loop:--html | campaign:-o | campaign:--out | campaign:--jobs | \
            campaign:--scheduler | campaign:--logs | campaign:--train | campaign:--config | \
            campaign:--channel | campaign:--limit | compare:--figures | compare:--alpha | \
            compare:--fail-on | compare:--json | compare:--html | fmu:-o | \
            fmu:--output | verify:--config | verify:--fuzzy-every | demo:-i | \
            demo:--interface | demo:-c | demo:--channel | demo:--config | \
            demo:--scenario | demo:-o | demo:--output)
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
        [[ $cur == -* ]] || _sim_ecu_words 'list play inject drive control faults design contact tune score figures loop campaign compare fmu verify demo completion'
        ;;
    list)
        options='-h --help'
        case $prev in
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -* ]] || _sim_ecu_nothing
        ;;
    play)
        options='-h --help -i --interface -c --channel --log --fast --config --no-truth --ahead'
        case $prev in
        -i | --interface) _sim_ecu_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _sim_ecu_channels; return ;;
        --log) _sim_ecu_files .log; return ;;
        --config) _sim_ecu_files .toml; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_words 'all-curves axle-box curves damp dry four-axles greasy half-wet leaf-patch low six-axles stop-and-go very-low wet'; _sim_ecu_files .toml ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    inject)
        options='-h --help -i --interface -c --channel --log --fast --config --no-truth --ahead --fault --list'
        case $prev in
        -i | --interface) _sim_ecu_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _sim_ecu_channels; return ;;
        --log) _sim_ecu_files .log; return ;;
        --config) _sim_ecu_files .toml; return ;;
        --fault) _sim_ecu_words 'loss: burst: crc: counter: dlc: bias: drift: freeze: spike: nan: status: swap: reverse: dead: swap-wiring: delay: sender: babble: error-flood: link-down: device-gone: bus-off:'; compopt -o nospace 2> /dev/null; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_words 'all-curves axle-box curves damp dry four-axles greasy half-wet leaf-patch low six-axles stop-and-go very-low wet'; _sim_ecu_files .toml ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    drive)
        options='-h --help -i --interface -c --channel --log --no-truth --json'
        case $prev in
        -i | --interface) _sim_ecu_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _sim_ecu_channels; return ;;
        --log) _sim_ecu_files .log; return ;;
        --json) _sim_ecu_files ''; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_words 'all-curves axle-box curves damp dry four-axles greasy half-wet leaf-patch low six-axles stop-and-go very-low wet'; _sim_ecu_files .toml ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    control)
        options='-h --help -i --interface -c --channel --with-adhesion --config --scenario --for'
        case $prev in
        -i | --interface) _sim_ecu_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _sim_ecu_channels; return ;;
        --config) _sim_ecu_files .toml; return ;;
        --scenario) _sim_ecu_words 'all-curves axle-box curves damp dry four-axles greasy half-wet leaf-patch low six-axles stop-and-go very-low wet'; _sim_ecu_files .toml; return ;;
        --for) _sim_ecu_nothing; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_words 'none thresholds creep' ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    faults)
        options='-h --help'
        case $prev in
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -* ]] || _sim_ecu_nothing
        ;;
    design)
        options='-h --help --config -o --output --form --search --budget --jobs --baselines --explain'
        case $prev in
        --config) _sim_ecu_words 'locomotive metro'; _sim_ecu_files .toml; return ;;
        -o | --output) _sim_ecu_files ''; return ;;
        --form) _sim_ecu_words 'wrcd paper'; return ;;
        --budget) _sim_ecu_nothing; return ;;
        --jobs) _sim_ecu_nothing; return ;;
        --baselines) _sim_ecu_files .json; return ;;
        --explain) _sim_ecu_files .json; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -* ]] || _sim_ecu_nothing
        ;;
    contact)
        options='-h --help --k-a --k-s'
        case $prev in
        --k-a) _sim_ecu_nothing; return ;;
        --k-s) _sim_ecu_nothing; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_files .csv ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    tune)
        options='-h --help --config -o --output --form --over --budget --played --seed --jobs --against'
        case $prev in
        --config) _sim_ecu_words 'locomotive metro'; _sim_ecu_files .toml; return ;;
        -o | --output) _sim_ecu_folders; return ;;
        --form) _sim_ecu_words 'wrcd paper'; return ;;
        --over) _sim_ecu_nothing; return ;;
        --budget) _sim_ecu_nothing; return ;;
        --played) _sim_ecu_nothing; return ;;
        --seed) _sim_ecu_nothing; return ;;
        --jobs) _sim_ecu_nothing; return ;;
        --against) _sim_ecu_files .json; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -* ]] || _sim_ecu_nothing
        ;;
    score)
        options='-h --help --suite --quick --jobs --design --baselines --beside --fail-on --json --html'
        case $prev in
        --suite) _sim_ecu_words 'paper grid robust rough harsh slow long canted peak transitions drops cycles dead foreign dry-hours fusion'; return ;;
        --jobs) _sim_ecu_nothing; return ;;
        --design) _sim_ecu_files .json; return ;;
        --baselines) _sim_ecu_files .json; return ;;
        --beside) _sim_ecu_nothing; return ;;
        --fail-on) _sim_ecu_words 'missed'; return ;;
        --json) _sim_ecu_files ''; return ;;
        --html) _sim_ecu_files ''; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -* ]] || _sim_ecu_nothing
        ;;
    figures)
        options='-h --help -o --output --design --paper'
        case $prev in
        -o | --output) _sim_ecu_folders; return ;;
        --design) _sim_ecu_files .json; return ;;
        --paper) _sim_ecu_files .json; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -* ]] || _sim_ecu_nothing
        ;;
    loop)
        options='-h --help --suite --only --quick --seeds --jobs --fail-on --json --html'
        case $prev in
        --suite) _sim_ecu_words 'braking traction train faults worlds actuators'; return ;;
        --only) _sim_ecu_nothing; return ;;
        --seeds) _sim_ecu_nothing; return ;;
        --jobs) _sim_ecu_nothing; return ;;
        --fail-on) _sim_ecu_words 'missed'; return ;;
        --json) _sim_ecu_files ''; return ;;
        --html) _sim_ecu_files ''; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -* ]] || _sim_ecu_nothing
        ;;
    campaign)
        options='-h --help -o --out --jobs --scheduler --again --dry-run --logs --train --config --channel --limit --reports'
        case $prev in
        -o | --out) _sim_ecu_folders; return ;;
        --jobs) _sim_ecu_nothing; return ;;
        --scheduler) _sim_ecu_nothing; return ;;
        --logs) _sim_ecu_nothing; return ;;
        --train) _sim_ecu_nothing; return ;;
        --config) _sim_ecu_files .toml; return ;;
        --channel) _sim_ecu_channels; return ;;
        --limit) _sim_ecu_nothing; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_files .toml ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    compare)
        options='-h --help --figures --alpha --fail-on --json --html'
        case $prev in
        --figures) _sim_ecu_nothing; return ;;
        --alpha) _sim_ecu_nothing; return ;;
        --fail-on) _sim_ecu_words 'worse any'; return ;;
        --json) _sim_ecu_files ''; return ;;
        --html) _sim_ecu_files ''; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_folders ;;
        1) _sim_ecu_folders ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    fmu)
        options='-h --help -o --output'
        case $prev in
        -o | --output) _sim_ecu_files .fmu; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_words 'all-curves axle-box curves damp dry four-axles greasy half-wet leaf-patch low six-axles stop-and-go very-low wet'; _sim_ecu_files .toml ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    verify)
        options='-h --help --config --fuzzy-every'
        case $prev in
        --config) _sim_ecu_files .toml; return ;;
        --fuzzy-every) _sim_ecu_nothing; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_files .log .gz .asc .blf .trc .csv .db .mf4 ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    demo)
        options='-h --help -i --interface -c --channel --config --scenario -o --output'
        case $prev in
        -i | --interface) _sim_ecu_words 'canalystii cantact etas gs_usb iscan ixxat kvaser neousys neovi nican nixnet pcan robotell seeedstudio serial slcan socketcan socketcand systec udp_multicast usb2can vector virtual'; return ;;
        -c | --channel) _sim_ecu_channels; return ;;
        --config) _sim_ecu_files .toml; return ;;
        --scenario) _sim_ecu_words 'all-curves axle-box curves damp dry four-axles greasy half-wet leaf-patch low six-axles stop-and-go very-low wet'; _sim_ecu_files .toml; return ;;
        -o | --output) _sim_ecu_folders; return ;;
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -* ]] || _sim_ecu_nothing
        ;;
    completion)
        options='-h --help'
        case $prev in
        :) _sim_ecu_nothing; return ;;
        esac
        [[ $cur == -?* ]] || case $position in
        0) _sim_ecu_words 'bash zsh' ;;
        *) _sim_ecu_nothing ;;
        esac
        ;;
    *) return ;;
    esac
    if [[ $cur == -* ]]; then
        _sim_ecu_words "$options"
    fi
}

complete -o default -F _sim_ecu sim-ecu
