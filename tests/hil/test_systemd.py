"""Judges what tests/hil/systemd.sh has recorded under a real systemd: the package, installed, upgraded from that of the
commit `studies` and removed as docs/how-to/install-on-train.md says, and its unit.

However the daemon ends and whatever happens around it: Valid frames come again without a person. Times are printed.
"""

import re
from itertools import pairwise

import pytest

from tests.hil.recording import NOT_AVAILABLE, slot_of, validity
from tests.hil.unit_recording import PAGE, Recording
from tests.support.processes import ROOT
from tests.support.snapshots import assert_kept
from wrcd import __version__
from wrcd.config.config import DEFAULT

EPISODES = re.findall(r"^episode (\w+)", (ROOT / "tests/hil/systemd.sh").read_text(), re.MULTILINE)
AXLES, WINDOW_SLOTS = 4, 50
# Sent after systemd has said that it stops the unit, and before it does: it may come late. A turn sends one.
MAX_STOPPING_FRAMES = 25
OTHERS = ["usr/local/lib/systemd/system/wrcd@.service", "usr/local/lib/wrcd/installed.json", "opt/wrcd/pyvenv.cfg"]

CALLS = {"read", "setpriority"}
FORBIDDEN_CALLS = {"chown", "mount", "ptrace", "reboot", "sched_setscheduler", "setrlimit"}


@pytest.fixture(scope="module")
def recording() -> Recording:
    return Recording(ROOT / "build/hil/systemd")


def test_recording_is_whole_and_nothing_was_waited_for_in_vain(recording: Recording) -> None:
    missing = [episode for episode in EPISODES if episode not in recording.marks_us]
    assert not missing, f"the guest has ended before the episode {missing[0]}"
    assert (recording.folder / "done").exists(), f"the guest has ended in the episode {EPISODES[-1]}"
    assert not (recording.folder / "in-vain").exists(), recording.text("in-vain")
    assert not [line for line in recording.journal if "Traceback" in line.text]


@pytest.mark.parametrize("other", OTHERS)
def test_package_is_refused_beside_another_installation(recording: Recording, other: str) -> None:
    folder, _, name = other.rpartition("/")
    assert recording.status(f"refused/{name}") == 1
    assert folder in recording.text(f"refused/{name}")
    assert recording.status(f"refused/{name}.program") == 1  # it is not there


def test_commands_of_the_page_succeed(recording: Recording) -> None:
    assert recording.text("page").splitlines() == PAGE
    for name in ("installed/install", "installed/enable", "upgraded/upgrade", "upgraded/restart", "removed/remove"):
        assert recording.status(name) == 0, recording.text(name)
    assert recording.status("purged/purge") == 0, recording.text("purged/purge")


@pytest.mark.parametrize(
    ("command", "version"), [("installed/enable", r".*~studies|0\.3\.0"), ("upgraded/restart", re.escape(__version__))]
)
def test_installed_package_runs_and_starts_with_the_computer(recording: Recording, command: str, version: str) -> None:
    episode = command.partition("/")[0]
    shown = recording.fields(f"{episode}/show")
    assert (shown["ActiveState"], shown["UnitFileState"]) == ("active", "enabled")
    assert shown["FragmentPath"] == "/lib/systemd/system/wrcd@.service"
    assert recording.back(command).pid == shown["MainPID"]
    assert re.match(
        rf"wrcd ({version})\n(.*\n)*(library|estimator:) C11, compiled by ", recording.text(f"{episode}/version")
    )
    # what arrives while the program starts must fit
    assert recording.text("installed/rmem_max") == "8388608\n"


@pytest.mark.parametrize("episode", ["installed", "upgraded", "realtime"])
def test_ready_is_said_when_the_daemon_hears_the_bus(recording: Recording, episode: str) -> None:
    assert re.search(r"^ *vcan0 +101 ", recording.text(f"{episode}/rcvlist_fil"), re.MULTILINE)


def test_upgrade_names_the_broken_configuration_and_restarts_nothing(recording: Recording) -> None:
    said, broken = recording.text("upgraded/upgrade"), "/etc/wrcd/vcan1.toml"
    assert f"{broken}:{len(DEFAULT.splitlines()) + 2}: limits.min_sped_m_s" in said
    assert f"{__version__} does not start with {broken}:\n" in said
    assert "/etc/wrcd/vcan0.toml" not in said
    assert f"what was there before runs until: {PAGE[3]}\n" in said
    assert recording.process("upgraded/upgrade") is recording.process("upgraded/restart")
    assert recording.process("installed").sent[-1].stamp_us > recording.marks_us["upgraded/restart"]


def test_installation_is_described_with_what_mends_it(recording: Recording) -> None:
    said = recording.text("upgraded/installation")
    for found in (
        r"ok +wrcd +.*/opt/wrcd", r"ok +library in C +compiled by", r"ok +CAN in the kernel +SocketCAN",
        r"ok +CAN interface +vcan0 up", r"ok +receive buffer +8388608 bytes", r"- +extra bench +not installed",
        r"- +real-time priority +none",
        r"ok +unit +/\S+/wrcd@\.service", r"ok +configuration +/etc/wrcd/vcan0\.toml: axles 1",
        r"NO +configuration +/etc/wrcd/vcan1\.toml is refused",
        r" +wrcd check --config /etc/wrcd/vcan1\.toml$", r" +/etc/wrcd/vcan1\.toml:.*min_sped_m_s",
    ):  # fmt: skip
        assert re.search(rf"^{found}", said, re.MULTILINE), (found, said)
    assert recording.status("upgraded/installation") == 1


def test_configuration_dump_and_edited_file_outlive_upgrade_and_removal(recording: Recording) -> None:
    for episode in ("upgraded", "removed"):
        assert recording.text(f"{episode}/vcan0.toml") == DEFAULT
        assert recording.text(f"{episode}/kept.log") == "a dump\n"
        assert recording.text(f"{episode}/80-wrcd.conf").endswith("# edited\n")
    assert recording.text("upgraded/80-wrcd.conf.dpkg-dist")  # the older package's was another


def test_removed_package_leaves_no_program_and_purged_no_trace(recording: Recording) -> None:
    assert recording.status("removed/cat") == 1
    assert recording.text("removed/left").count("No such file or directory") == 2
    before, after = (set(recording.text(f"{episode}/changes").splitlines()) for episode in ("refused", "purged"))
    assert "etc/systemd/journald.conf.d/guest.conf f 644 " in before  # it is one of the guest's
    assert sorted(before ^ after) == []


def test_broken_configuration_is_not_started_again(recording: Recording) -> None:
    assert recording.status("broken/start") == 1
    shown = recording.fields("later/broken")
    assert (shown["ActiveState"], shown["NRestarts"], shown["ExecMainStatus"]) == ("failed", "0", "2")


@pytest.mark.parametrize("episode", ["limited", "killed", "sandboxed"])
def test_killed_daemon_is_back_with_valid_frames(recording: Recording, episode: str) -> None:
    recording.back(f"{episode}/kill")
    assert recording.said(episode).count("Main process exited, code=killed, status=9/KILL") == 1


def test_hung_daemon_is_killed_by_the_watchdog(recording: Recording) -> None:
    recording.back("hung/hang")
    said = recording.said("hung")
    assert "Watchdog timeout (limit 2s)" in said
    assert re.search(r"Fatal Python error: Aborted\n(.*\n)*.*/loop\.py", said)  # it says where it hung


def test_out_of_memory_restarts_the_daemon(recording: Recording) -> None:
    """A leak ends in its own death, not in the train computer's."""
    assert re.search(r"killed by the OOM killer\.\n(.*\n)*.*Scheduled restart job", recording.said("memory"))
    recording.back("memory/enough")


def test_restart_takes_over_a_changed_configuration_and_reload_is_refused(recording: Recording) -> None:
    """There by systemctl, and back by SIGHUP, which ends the daemon as SIGTERM does."""
    assert recording.status("restarted/reload") != 0
    old, slow = recording.process("upgraded/restart"), recording.process("restarted/reload")
    assert slow is recording.process("restarted/restart")
    assert len(slow.sent) > 2 * WINDOW_SLOTS
    assert {validity(f) for f in slow.sent} == {NOT_AVAILABLE}
    took_us = recording.marks_us["restarted/restart.ended"] - recording.marks_us["restarted/restart"]
    gap_us = slow.sent[0].stamp_us - old.sent[-1].stamp_us
    print(f"systemctl restart: {took_us * 1e-6:.2f} s; between two frames: {gap_us * 1e-6:.2f} s")
    recording.back("restarted/hangup")


@pytest.mark.parametrize(("episode", "start"), [("restarted", "upgraded/restart"), ("stopped", "restarted/hangup")])
def test_stopped_daemon_soon_sends_not_available_and_ends(recording: Recording, episode: str, start: str) -> None:
    stops_us = [line.stamp_us for line in recording.journal if line.text.startswith("Stopping wrcd@vcan0.")]
    began_us = min(us for us in stops_us if us > recording.marks_us[episode])
    left = [f for f in recording.process(start).sent if f.stamp_us > began_us]
    print(f"{len(left)} frames after systemd began to stop it")
    assert len(left) <= MAX_STOPPING_FRAMES
    assert validity(recording.process(start).sent[-1]) == NOT_AVAILABLE
    assert "wrcd: stopped;" in recording.said(episode)
    shown = recording.fields("stopped/show")
    assert (shown["Result"], shown["ExecMainStatus"]) == ("success", "0")


def test_no_slot_is_sent_twice_and_one_that_is_missing_is_told(recording: Recording) -> None:
    """A line tells of a second. With the device gone nothing is sent, and the last frame is of a slot further on."""
    assert all(slot_of(a) < slot_of(b) for a, b in pairwise(f for process in recording.processes for f in process.sent))
    for pid, sent in recording.processes:
        until_us = min(sent[-1].stamp_us - 2_000_000, recording.marks_us["device"])
        slots = [slot_of(f) for f in sent if f.stamp_us < until_us]
        missing = slots[-1] - slots[0] + 1 - len(slots) if slots else 0
        text = "\n".join(line.text for line in recording.journal if line.pid == pid)
        # the older package says it in other words
        left_out = sum(
            map(int, re.findall(r"(\d+) frames(?: not sent: computer too late|: their slot was over)", text))
        )
        print(f"process {pid}: {len(slots)} slots sent, {missing} missing; {left_out} frames left out")
        assert AXLES * missing <= left_out


MISSING = [
    ("missing", "vcan9", "CAN interface 'vcan9' cannot be opened: No such"),
    ("later", "vcan1", "/wrcd/vcan1.toml"),
]


@pytest.mark.parametrize(("episode", "name", "what"), MISSING)
def test_what_is_missing_at_the_start_is_waited_for(recording: Recording, episode: str, name: str, what: str) -> None:
    """One start in twenty seconds, not one every few hundredths of a second; and READY=1 is not said before."""
    waiting, shown = recording.fields(f"{episode}/waiting"), recording.fields(f"{episode}/show")
    assert (waiting["ActiveState"], shown["ActiveState"]) == ("activating", "active")
    looks_us = [line.stamp_us for line in recording.journal if re.search(rf"{what}.*; waiting for it, ", line.text)]
    assert all(b - a > 19_000_000 for a, b in pairwise(looks_us))
    assert waiting["NRestarts"] == shown["NRestarts"] == str(len(looks_us) - 1)
    assert (waiting["NRestarts"] == "0") == (episode == "later")
    ready_us = next(line.stamp_us for line in recording.journal if line.text.startswith(f"Started wrcd@{name}."))
    print(f"running {(ready_us - recording.marks_us[f'{episode}/come']) * 1e-6:.2f} s after it has come")


def test_unit_has_each_of_its_settings(recording: Recording) -> None:
    """As systemctl shows it; SECURITY.md says what is shut in, and why."""
    shown = recording.fields("sandboxed/show")
    names = re.findall(r"^(\w+)=", (ROOT / "systemd/wrcd@.service").read_text(), re.MULTILINE)
    names = [re.sub("Sec$", "USec", name).replace("File", "Files") for name in dict.fromkeys(names)]
    kept = [name for name in names if name not in ("After", "ExecStart", "SystemCallFilter", "WantedBy")]
    assert_kept("unit", "settings", [" ".join([f"{name}:", *sorted(shown[name].split())]) for name in kept])
    calls = set(shown["SystemCallFilter"].split())
    assert (CALLS - calls, FORBIDDEN_CALLS & calls) == (set(), set())


def test_unit_is_sandboxed(recording: Recording) -> None:
    fields = recording.fields("sandboxed/status")
    assert (fields["CapEff"], fields["NoNewPrivs"], fields["Seccomp"]) == ("0000000000000000", "1", "2")
    assert int(fields["Uid"].split()[0]) >= 61184  # a dynamic user
    exposure = re.search(r"Overall exposure level for \S+: ([0-9.]+)", recording.text("sandboxed/security"))
    assert exposure is not None
    print(exposure[0])
    assert float(exposure[1]) <= 1.5


def test_sandboxed_daemon_has_its_rtnetlink_socket(recording: Recording) -> None:
    """Shut in as it is, it has a socket of rtnetlink's group of links; otherwise it would do without, and be slower."""
    sockets = re.findall(r"socket:\[(\d+)\]", recording.text("sandboxed/sockets"))
    listed = [line.split() for line in recording.text("sandboxed/netlink").splitlines()]
    assert [(words[1], words[3]) for words in listed if words[-1] in sockets] == [("0", "00000001")]


def test_drop_ins_give_realtime_priority_and_locked_memory(recording: Recording) -> None:
    assert (recording.status("realtime/verify"), recording.text("realtime/verify")) == (0, "")
    assert "sys-subsystem-net-devices-vcan0.device" in recording.fields("realtime/bound")["BindsTo"]
    recording.back("realtime/start")
    # the children do not inherit it
    assert "SCHED_FIFO|SCHED_RESET_ON_FORK\n" in recording.text("realtime/scheduler")
    fields = recording.fields("realtime/status")
    print(f"locked {fields['VmLck']}, resident {fields['VmRSS']}")
    assert int(fields["VmLck"].split()[0]) > 10_000
    counts = [recording.said(episode).count("memory is not locked: ") for episode in ("realtime", "limited")]
    assert counts == [0, 1]


def test_device_deleted_and_made_again_is_used_by_the_same_process(recording: Recording) -> None:
    process = recording.back("device/come", recording.processes[-1])
    told = [line.pid for line in recording.journal if re.search("CAN device (is gone|was opened again)", line.text)]
    assert told == [process.pid, process.pid]
