#!/bin/bash
# Records in $OUT what the Debian package and its unit do under a real systemd, for tests/hil/test_systemd.py to judge;
# `make systemd` runs it in the guest. canplayer is the train. An episode is a folder. `marks` has when it and its commands
# began and ended, `bus.log` what candump heard of Adhesion_A1, `journal` the units' lines, `in-vain` what was
# waited for and did not come. The last file is `done`.
cd "$(dirname "${BASH_SOURCE[0]}")/../../build/unit" || exit
export LC_ALL=C
unit=wrcd@vcan0 config=/etc/wrcd/vcan0.toml drop_ins=/etc/systemd/system/wrcd@vcan0.service.d new=$(echo "$PWD"/*.deb)
mapfile -t page <page # the commands of docs/how-to/install-on-train.md, which are called where its packages lie
cp page "$OUT"
cp -r dpkg /tmp/dpkg
mkdir /tmp/page
ln -s "$PWD"/older/*.deb "/tmp/page/${page[0]##* }"
ln -s "$new" "/tmp/page/${page[2]##* }"
dpkg() { command dpkg --admindir /tmp/dpkg --force-confold "$@"; }
of_page() { (cd /tmp/page && eval "${page[$1]}"); }

mark() { echo "$1 $EPOCHREALTIME" >>"$OUT/marks"; }
episode() {
    episode=$1 folder=$OUT/$1
    mkdir "$folder"
    mark "$1"
}
run() { # run NAME COMMAND...: what it prints goes to NAME, its exit status to NAME.status
    local name=$1
    mark "$episode/$name"
    "${@:2}" >"$folder/$name" 2>&1
    echo $? >"$folder/$name.status"
    mark "$episode/$name.ended"
}
show() { systemctl show --all "${2-$unit}" >"$folder/$1"; } # show NAME [UNIT]
pid() { systemctl show -p MainPID --value $unit; }
until_() { # until_ WHAT COMMAND...: look now and then, for a minute and a half
    local looks=0
    until "${@:2}"; do
        if ((looks++ > 300)); then echo "$episode: $1" >>"$OUT/in-vain"; return; fi
        sleep .3
    done
}
said() { [ "$(grep -c "$1" "$OUT/journal")" -gt "${2-0}" ]; } # said PATTERN [TIMES]: more often than that
heard() { [ "$(wc -l <"$OUT/bus.log")" -gt "$1" ]; }
valid_since() {
    local stamp frame
    while read -r stamp _ frame; do
        [[ $stamp < "($1)" || $frame != 091#??1* ]] || return 0
    done < <(tail -n 5 "$OUT/bus.log")
    return 1
}
back() { # back NAME COMMAND...: run it, until a process that began since then sends Valid frames
    local first_line='"wrcd: socketcan:vcan0, ' starts
    starts=$(grep -c "$first_line" "$OUT/journal")
    run "$@"
    cp /proc/net/can/rcvlist_fil "$folder" # at once: who listens when systemctl returns, as READY=1 was said
    until_ 'a new process' said "$first_line" "$starts"
    until_ 'Valid frames' valid_since "$EPOCHREALTIME"
}
comes() { # comes UNIT COMMAND...: what the unit waits for
    show waiting "$1"
    run come "${@:2}"
    until_ 'the unit to run' systemctl -q is-active "$1"
    show show "$1"
    systemctl stop "$1"
}
listen() { # the sensors wait for no processor, as on a train
    candump -r 8388608 -L vcan0,091:7FF >>"$OUT/bus.log" 2>/dev/null &
    bus=$!
    chrt -f 10 canplayer -l i -I dry.log vcan0=can0 >/dev/null 2>&1 &
    bus+=" $!"
}
patient() { # the watchdog is tried in `hung` only: the host may be busy with something else
    mkdir -p /run/systemd/system/wrcd@.service.d
    printf '[Service]\nWatchdogSec=60s\n' >/run/systemd/system/wrcd@.service.d/patient.conf
    systemctl daemon-reload
}
states() { # kind, mode and link of each path that comes in, and a file's content
    # shellcheck disable=SC2016
    xargs -0r sh -c 'find "$@" -maxdepth 0 -printf "%p %y %m %l\n"; find "$@" -maxdepth 0 -type f -exec sha256sum {} +' - \
        2>/dev/null | sort
}
changes() ( # all that is otherwise than when the guest was booted, but for what systemd and dpkg keep for themselves
    but='^(etc/\.pwd\.lock|run/(log|systemd|credentials)|var/(lib/systemd|log/journal|log/(dpkg|alternatives)\.log|cache/debconf))(/|$)'
    cd /run/guest/upper
    find etc usr opt var srv boot lib bin sbin -print0 2>/dev/null | grep -zvE "$but" >/tmp/names
    comm -23 <(states </tmp/names) <(cd /run/guest/lower && states </tmp/names)
    cd /
    find run etc/systemd/system var/lib/private -path run/guest -prune -o -print0 | grep -zvE "$but" | states
)

patient
journalctl -f -n all -o json --output-fields=MESSAGE,_PID,_SOURCE_REALTIME_TIMESTAMP \
    -u $unit -u wrcd@vcan1 -u wrcd@vcan9 >"$OUT/journal" 2>/dev/null &
journal=$!

episode refused # beside another installation's unit, its list of files, or a virtual environment
run changes changes
for other in /usr/local/lib/systemd/system/wrcd@.service /usr/local/lib/wrcd/installed.json /opt/wrcd/pyvenv.cfg; do
    made=$(mkdir -pv "${other%/*}" | sed "s/.*'\(.*\)'/\1/")
    touch "$other"
    run "${other##*/}" dpkg -i "$new"
    run "${other##*/}.program" test -e /opt/wrcd/bin/wrcd
    rm "$other"
    tac <<<"$made" | xargs -r rmdir
done

episode installed # the older package
run install of_page 0
cp /proc/sys/net/core/rmem_max "$folder"
cp vcan0.toml $config
echo "WRCD_OPTIONS=--config $config" >/etc/wrcd/vcan0.env
listen
back enable of_page 1
show show
run version /opt/wrcd/bin/wrcd --version
echo 'a dump' >/var/lib/wrcd/vcan0/kept.log

episode upgraded # with an edited file of the receive buffers, and a configuration that is broken
echo '# edited' >>/etc/sysctl.d/80-wrcd.conf
(cat vcan0.toml; printf '[limits]\nmin_sped_m_s = 3\n') >/etc/wrcd/vcan1.toml
echo 'WRCD_OPTIONS=--config /etc/wrcd/vcan1.toml' >/etc/wrcd/vcan1.env
run upgrade of_page 2
back restart of_page 3
run installation /opt/wrcd/bin/wrcd check --installation
cp $config /var/lib/wrcd/vcan0/kept.log /etc/sysctl.d/80-wrcd.conf* "$folder"
show show
run version /opt/wrcd/bin/wrcd --version

episode broken # started all the same
run start systemctl start wrcd@vcan1

episode restarted # by a changed configuration: by systemctl, and back by SIGHUP
printf '[limits]\nmin_speed_m_s = 59\n' >>$config
run reload systemctl reload $unit
run restart systemctl restart $unit
until_ 'frames of two windows' heard $(($(wc -l <"$OUT/bus.log") + 150))
cp vcan0.toml $config
back hangup systemctl kill --signal=HUP $unit

episode later # a configuration on a mount that comes later
show broken wrcd@vcan1
rm /etc/wrcd/vcan1.toml
systemctl start --no-block wrcd@vcan1
until_ 'a look for it' said 'vcan1.toml.*; waiting for it, '
comes wrcd@vcan1 cp vcan0.toml /etc/wrcd/vcan1.toml

episode stopped
run stop systemctl stop $unit
show show

episode realtime # here is no udev to bring a device: device.conf is only read
mkdir $drop_ins
cp ../../systemd/wrcd@.service.d/{device,realtime}.conf $drop_ins
run verify systemd-analyze verify $unit.service
systemctl daemon-reload
show bound
rm $drop_ins/device.conf
systemctl daemon-reload
back start systemctl start $unit
run scheduler chrt -p "$(pid)"
cp "/proc/$(pid)/status" "$folder"

episode limited # in the memory that it may lock, from its next process on
echo LimitMEMLOCK=64K >>$drop_ins/realtime.conf
systemctl daemon-reload
back kill kill -9 "$(pid)"

episode killed
rm -r $drop_ins
systemctl daemon-reload
back kill kill -9 "$(pid)"
systemctl start --no-block wrcd@vcan9 # for `missing`

episode sandboxed # by the unit alone
rm /run/systemd/system/wrcd@.service.d/patient.conf
systemctl daemon-reload
back kill kill -9 "$(pid)"
show show
cp "/proc/$(pid)/status" /proc/net/netlink "$folder"
run sockets find "/proc/$(pid)/fd" -printf '%l\n'
run security systemd-analyze security --no-pager $unit

episode hung
hang() { kill -STOP "$(pid)"; until_ 'the watchdog' said 'Watchdog timeout'; patient; }
back hang hang

episode memory # too little of it
systemctl set-property --runtime $unit MemoryMax=12M
until_ 'the kill' said 'killed by the OOM killer'
back enough systemctl set-property --runtime $unit MemoryMax=256M

episode missing # an interface that comes when a second process waits for it
until_ 'the second start' said 'vcan9.*; waiting for it, ' 1
comes wrcd@vcan9 ip link add vcan9 type vcan
ip link del vcan9

episode device # deleted and made again; candump and canplayer need to be started anew
ip link del vcan0
until_ 'the loss' said 'the CAN device is gone'
kill $bus 2>/dev/null
ip link add vcan0 mtu 72 type vcan
ip link set vcan0 up
run come listen
until_ 'the device' said 'the CAN device was opened again'
until_ 'Valid frames' valid_since "$EPOCHREALTIME"

episode removed
run remove of_page 4
run cat systemctl cat $unit
run left ls -d /opt/wrcd /usr/bin/wrcd
cp $config /var/lib/wrcd/vcan0/kept.log /etc/sysctl.d/80-wrcd.conf "$folder"

episode purged
run purge of_page 5
run changes changes
kill $bus $journal
wait
touch "$OUT/done"
