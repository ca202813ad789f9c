#!/bin/bash
# vcan.sh PLAY: what the daemon does on a kernel's CAN interfaces, recorded into $OUT, an episode after the other. Judges
# nothing: tests/hil/test_*.py do, on the host. PLAY is what tests/hil/prepare.py has made. Needs root, and vcan0.
#
# An episode's folder: bus.log (candump, error frames too), said (the daemon's standard error), marks (NAME SECONDS),
# exit (its status). What was waited for in vain is a mark TIMEOUT. The file `done` is the last that is written.
set -u
play=$1
for program in candump canplayer cansend cangen chrt wrcd; do
    command -v $program >/dev/null || { echo "no $program on PATH" >&2; exit 1; }
done
adhesion=091 # the id that a daemon is known by

mark() { echo "$1 $EPOCHREALTIME" >>marks; }

until_() { # until_ TENTHS COMMAND...: until it succeeds, so long at most
    local left=$1
    shift
    until "$@"; do
        if ((--left < 0)); then mark "TIMEOUT: $*"; return 1; fi
        sleep .1
    done
}

seen() { grep -q " $adhesion#" bus.log; }

begin() { # begin EPISODE INTERFACE [CONFIGURATION]: candump and the daemon; $before is what to start it with
    mkdir -p "$OUT/$1" && cd "$OUT/$1" || exit
    bus=$2
    [ $# = 2 ] || cp "$play"/{"$3",train.dbc} . # the recorder writes beside it
    # Of all interfaces: one that is deleted and made again is heard, too. It loses nothing: the bus waits for it
    chrt -f 50 candump -r 8388608 -L any,0:0,#FFFFFFFF >bus.log 2>candump & heard=$!
    ${before-} ${WRCD-wrcd} run -i socketcan -c "$bus" ${3:+--config "$3"} 2>said & daemon=$!
    until_ 900 seen
    mark begin
}

newest() { tail -c 4000 bus.log | sed -n "s/^(\([0-9]*\)\.\([0-9]*\)) [^ ]* $adhesion#.*/\1\2/p" | tail -1; }

after() { # after MICROSECONDS: whether an Adhesion frame was sent after that
    local newest
    newest=$(newest)
    ((${newest:-0} > $1))
}

settle() { # the daemon has taken all that was on the bus until now
    local now=${EPOCHREALTIME/./}
    until_ 900 after $((now + 300000))
}

end() { # stop the daemon, and candump; one that does not end is made to
    settle
    mark stop
    kill -TERM $daemon
    (sleep 20; kill -KILL $daemon) 2>/dev/null & local guard=$!
    wait $daemon
    echo $? >exit
    mark stopped
    kill $guard
    sleep .3
    kill -INT $heard
    wait $heard
}

played() { # played LOG [OPTION...]: on this episode's interface. A sensor waits for nobody's processor
    mark "play ${1%.log}"
    chrt -f 10 canplayer -I "$play/$1" "${@:2}" "$bus=can0" 2>>canplayer
    mark "played ${1%.log}"
}

put() { cansend "$bus" "$1"; }

link() { # link WORD...: ip link
    mark "$*"
    ip link "$@"
}

# --- the episodes

export COVERAGE_FILE=$OUT/data # `make coverage`
if [ "${GUEST-}" = uml ]; then
    echo 8388608 >/proc/sys/net/core/rmem_max # as systemd/80-wrcd.conf has it
else
    ip link add vcan1 mtu 72 type vcan && ip link set vcan1 up
fi

# four axles, a silence, one axle; a dump
begin axles vcan0 recorded.toml
played four.log
sleep 3
played dry.log
settle
mark dump
kill -USR1 $daemon
dumped() { compgen -G '*-asked.log' >/dev/null; }
until_ 900 dumped
end

begin six vcan0 six.toml
played six.log
wrcd dump -i socketcan -c vcan0 --config six.toml --state >state
end

# three faults of the matrix
begin faults vcan0
played faults.log
end

# garbage, and as much as can-utils send, on a computer that has other work, too: as realtime.conf has it
before='chrt -f 40' begin flood vcan0
for line in 101# 101#00 101#R 101#0011223344556677 091#FFFFFFFFFFFFFFFF 00000101#0011223344 130#FFFFFFFF 7FF# \
    121##1001122334455667788 20000040#0000000000000000; do put "$line"; done
cangen vcan0 -g 0 -I 300 -L r -D r & flood=$!
played dry.log
kill $flood
canplayer -t -g 0 -l i -I "$play/garbage.log" vcan0=can0 & flood=$!
played dry.log
kill $flood
end

# a daemon that stands still: what nobody wants does not fill its buffer, what is lost is counted
begin lost vcan0
kill -STOP $daemon
cangen vcan0 -n 20000 -g 0 -I 300 -L 5 -D r
played few.log -t
kill -CONT $daemon
settle
sleep 1.2
kill -STOP $daemon
mark full
cangen vcan0 -n 30000 -g 0 -I 101 -L 5 -D r
kill -CONT $daemon
settle
sleep 1.2 # a line of the journal a second
end

# a link that goes and comes back
begin link vcan1
played ride1.log
link set vcan1 down
sleep .5
link set vcan1 up
played ride2.log
link set vcan1 down
link set vcan1 up
sleep .3
link del vcan1
sleep .5
link add vcan1 mtu 72 type vcan
link set vcan1 up
played ride3.log
link del vcan1
link add vcan1 mtu 72 type vcan
link set vcan1 up
played ride4.log
end

# error frames, and somebody else who sends under the daemon's ids
begin errors vcan1
mark off
put 20000040#0000000000000000
sleep 2.5
mark restarted
put 20000100#0000000000000000
sleep 1.2
put 20000040#0000000000000000
sleep 1.2
mark frame
put 101#0011223344
for state in 20 10 08 30 40; do
    mark "state $state"
    put 20000004#00${state}000000000000
    sleep 1.2
done
put 20000004#0001000000000000
played errors.log
put 20000040#0000000000000000
sleep 1.2
put 20000100#0000000000000000
sleep 1.2
played foreign.log
sleep 1.2
end

# CAN FD; stamps of a controller's own, where there are none
adhesion=301 begin fd vcan1 fd.toml
adhesion=301 played fd.log
adhesion=301 settle
mark dump
kill -USR1 $daemon
until_ 900 dumped
adhesion=301 end

# a controller that goes off the bus, a clock that is set, and a line that nobody reads
mkfifo "$OUT/orders"
python3 "$play/peer.py" can7 "$play/busoff.log" "$OUT/line" <"$OUT/orders" & peer=$!
exec 7>"$OUT/orders"
is_up() { ip link show can7 up 2>/dev/null | grep -q can7; }
until_ 300 is_up
begin busoff can7
order() {
    mark "$1"
    echo "$1" >&7
}
order play
sleep 3
order off
sleep .5
order active
link set can7 down
link set can7 up
sleep 3
steps='3600 -3600 .4 -.4'
[ "${GUEST-}" = uml ] || steps='' # nobody sets the clock of a machine that is in use
for step in $steps; do
    mark "step $step"
    date -s "@$(awk -v now=$EPOCHREALTIME -v step=$step 'BEGIN { printf "%.6f", now + step }')" >/dev/null
    mark "stepped $step"
    sleep 2.5
done
order deaf
sleep 3
order hear
sleep .5
order quiet
end
order end
wait $peer
exec 7>&-
rm "$OUT/orders"

[ "${GUEST-}" = uml ] || ip link del vcan1
echo done >"$OUT/done"
