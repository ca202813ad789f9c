"""`wrcd install` below a folder: what is laid out, taken over, kept and named."""

import gzip
import json
import os
import shutil
from pathlib import Path, PurePosixPath

import pytest

from tests.unit.tools.install.lab import BY_HAND, DATA, MANIFEST, PROGRAM, UNIT, Lab
from wrcd import __version__
from wrcd.config import DEFAULT
from wrcd.tools.install import previous
from wrcd.tools.install.files import BUILT_FOR, DEBIAN, LOCAL, Laid, Layout, lay_out
from wrcd.tools.install.groups import GROUPS
from wrcd.tools.install.tree import Tree

SYSCTL = "etc/sysctl.d/80-wrcd.conf"
OLD_UNIT = "etc/systemd/system/wrcd@.service"
LINK = "etc/systemd/system/multi-user.target.wants/wrcd@can0.service"


class CutOff(BaseException):
    """The power fails."""


@pytest.fixture
def lab(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Lab:
    return Lab(tmp_path / "root", capsys)


def test_units_start_the_program_that_is_installing(lab: Lab) -> None:
    lab.install("--with", "rig", program="/srv/wrcd-9/bin/wrcd")
    unit = lab.read(UNIT)
    assert "\nExecStart=/srv/wrcd-9/bin/wrcd run " in unit
    assert "\nExecReload=/usr/bin/nice -n 29 /srv/wrcd-9/bin/wrcd reload " in unit
    assert "/opt/wrcd" not in unit
    assert "\nExecStart=/srv/wrcd-9/bin/sim-ecu play " in lab.read(f"{LOCAL.units}/sim-ecu@.service")
    assert str(lab.path("usr/local/bin/wrcd").readlink()) == "/srv/wrcd-9/bin/wrcd"


def test_folder_of_a_copy_is_made(lab: Lab, tmp_path: Path) -> None:
    lab.root = tmp_path / "images/new"
    lab.install()
    assert lab.path(UNIT).exists()


def test_every_file_of_systemd_is_package_data_but_the_debian_packages_scripts() -> None:
    files = {p.relative_to(DATA) for p in DATA.rglob("*") if p.is_file()}
    systemd = Path(__file__).parents[4] / "systemd"
    own = {p.relative_to(systemd) for p in systemd.rglob("*") if p.is_file()}
    assert files == {p for p in own if p.parts[0] != "deb"}
    assert all((DATA / f).read_bytes() == (systemd / f).read_bytes() for f in files)


@pytest.mark.parametrize("layout", [LOCAL, DEBIAN], ids=["local", "debian"])
def test_nothing_harmful_is_laid_out_without_being_asked_for(layout: Layout) -> None:
    """No bit rate, no simulated sensors, no real-time priority."""
    laid = lay_out(layout, PurePosixPath(PROGRAM))
    assert [p for p in laid if p.startswith("etc/")] == [SYSCTL]
    assert [p for p in laid if p.startswith(layout.units)] == [f"{layout.units}/wrcd@.service"]
    asked = lay_out(layout, PurePosixPath(PROGRAM), GROUPS)
    assert {p for p in asked if p not in laid} >= {
        "etc/systemd/network/80-can0.network",
        "etc/systemd/network/80-vcan0.netdev",
        "etc/systemd/network/80-vcan0.network",
        f"{layout.units}/wrcd@.service.d/realtime.conf",
        f"{layout.units}/sim-ecu@.service",
    }


def test_manual_pages_and_completion_lie_where_they_are_looked_for(tmp_path: Path) -> None:
    data = tmp_path / "data"
    shutil.copytree(DATA, data / "systemd")
    for name in ("man/wrcd.1", "man/wrcd.toml.5", "man/sim-ecu.1", "man/README.md", "completion/wrcd.bash",
                 "completion/_wrcd", "completion/sim-ecu.bash", "completion/_sim-ecu"):  # fmt: skip
        (data / name).parent.mkdir(exist_ok=True)
        (data / name).write_text(f"text of {name}")
    train = lay_out(DEBIAN, PurePosixPath(PROGRAM), data=data)
    assert gzip.decompress(train["usr/share/man/man1/wrcd.1.gz"].content) == b"text of man/wrcd.1"
    assert gzip.decompress(train["usr/share/man/man5/wrcd.toml.5.gz"].content) == b"text of man/wrcd.toml.5"
    assert train["usr/share/bash-completion/completions/wrcd"].content == b"text of completion/wrcd.bash"
    assert train["usr/share/zsh/vendor-completions/_wrcd"].content == b"text of completion/_wrcd"
    assert not [p for p in train if "README" in p or ("sim-ecu" in p and "/examples/" not in p)]
    rig = lay_out(LOCAL, PurePosixPath(PROGRAM), ["rig"], data=data)
    assert {
        "usr/local/share/man/man1/sim-ecu.1.gz",
        "usr/local/share/bash-completion/completions/sim-ecu",
        "usr/local/share/zsh/site-functions/_sim-ecu",
    } <= set(rig)


def test_program_that_lies_where_its_link_would_has_none() -> None:
    assert "usr/local/bin/wrcd" not in lay_out(LOCAL, PurePosixPath("/usr/local/bin/wrcd"))


def test_second_installation_changes_nothing(lab: Lab) -> None:
    lab.install("--with", "can0")
    before = lab.snapshot()
    said = lab.install()
    assert lab.snapshot() == before
    assert f"wrcd {__version__} is installed; units start {PROGRAM}; with can0\n" in said
    assert lab.words(said) == ["unchanged"]


def test_dry_run_says_the_same_and_changes_nothing(lab: Lab) -> None:
    lab.by_hand()
    before = lab.snapshot()
    dry = lab.install("--dry-run")
    assert lab.snapshot() == before
    assert dry == "dry run: nothing is changed\n" + lab.install()


def test_group_is_kept_by_later_installations_until_it_is_dropped(lab: Lab) -> None:
    dropin = f"{LOCAL.units}/wrcd@.service.d/realtime.conf"
    lab.install("--with", "realtime")
    lab.install()
    assert lab.path(dropin).exists()
    said = lab.install("--without", "realtime")
    assert f"removed    /{dropin}" in said
    assert not lab.path(dropin).parent.exists()
    assert "asked for and not" in lab.refused("--with", "rig", "--without", "rig")


def test_checksums_of_0_1_0_know_its_files() -> None:
    for path in sorted(p for p in BY_HAND.iterdir() if p.is_file()):
        assert previous.is_unmodified(path.name, Tree(path.parent).checksum(path.name) or ""), path
    assert not previous.is_unmodified("wrcd@.service", "0" * 64)


def test_unmodified_files_of_0_1_0_are_taken_over(lab: Lab) -> None:
    """A unit in /etc would hide the one that is installed; what was enabled stays enabled."""
    lab.by_hand()
    lab.link(LINK, f"/{OLD_UNIT}")
    said = lab.install()
    assert f"wrcd 0.1.0, laid out by hand -> {__version__}; units start {PROGRAM}; with can0, rig\n" in said
    assert f"removed    /{OLD_UNIT}: 0.1.0, not edited: taken over" in said
    assert f"changed    /{SYSCTL}: 0.1.0, not edited: taken over" in said
    assert not lab.path(OLD_UNIT).exists()
    assert not lab.path("etc/systemd/system/sim-ecu@.service").exists()
    assert str(lab.path(LINK).readlink()) == f"/{UNIT}"
    assert lab.path(f"{LOCAL.units}/sim-ecu@.service").exists()
    lab.uninstall()
    assert lab.files() == []


def test_edited_files_of_0_1_0_are_kept_and_named(lab: Lab) -> None:
    lab.by_hand()
    lab.link(LINK, f"/{OLD_UNIT}")
    for path in (OLD_UNIT, SYSCTL):
        lab.edit(path)
    before = {path: lab.read(path) for path in (OLD_UNIT, SYSCTL)}
    said = lab.install()
    assert f"kept       /{OLD_UNIT}: not installed by wrcd, and it hides /{UNIT}" in said
    assert f"kept       /{SYSCTL}: edited here; the new one is 80-wrcd.conf.wrcd-new" in said
    assert {path: lab.read(path) for path in before} == before
    assert str(lab.path(LINK).readlink()) == f"/{OLD_UNIT}"
    again = lab.install()
    assert lab.words(again) == ["kept", "kept", "unchanged"]
    lab.uninstall()
    assert lab.files() == sorted([SYSCTL, OLD_UNIT, LINK])


def test_edited_file_is_not_overwritten_by_an_upgrade(lab: Lab, tmp_path: Path) -> None:
    """The new one lies beside it, once; when the edited one is as the new one, that goes."""
    lab.install(data=lab.older(tmp_path))
    lab.edit(UNIT)
    lab.edit(SYSCTL)
    edited = lab.read(UNIT), lab.read(SYSCTL)
    said = lab.install()
    assert (lab.read(UNIT), lab.read(SYSCTL)) == edited
    assert f"kept       /{UNIT}: edited here; the new one is wrcd@.service.wrcd-new" in said
    new = lab.path(f"{UNIT}.wrcd-new")
    assert f"ExecStart={PROGRAM} run" in new.read_text()
    before = lab.snapshot()
    assert lab.words(lab.install()) == ["kept", "kept", "unchanged"]
    assert lab.snapshot() == before
    lab.path(UNIT).write_bytes(new.read_bytes())
    lab.install()
    assert not new.exists()


def test_others_file_of_the_name_of_a_new_one_is_not_overwritten(lab: Lab, tmp_path: Path) -> None:
    lab.install(data=lab.older(tmp_path))
    lab.edit(UNIT)
    lab.write(f"{UNIT}.wrcd-new", "mine")
    assert "the new one is wrcd@.service.wrcd-new-2" in lab.install()
    assert lab.read(f"{UNIT}.wrcd-new") == "mine"
    new = lab.path(f"{UNIT}.wrcd-new-2")
    assert f"ExecStart={PROGRAM} run" in new.read_text()
    before = lab.snapshot()
    lab.install()
    assert lab.snapshot() == before
    lab.path(UNIT).write_bytes(new.read_bytes())
    lab.install()
    assert not new.exists()
    lab.uninstall()
    assert lab.files() == [f"{UNIT}.wrcd-new"]


def test_file_that_was_saved_before_is_not_overwritten(lab: Lab) -> None:
    network = "etc/systemd/network/80-can0.network"
    for edit in ("first", "second"):
        lab.install("--with", "can0")
        lab.write(network, edit)
        said = lab.install("--without", "can0")
    assert "renamed to 80-can0.network.wrcd-saved-2" in said
    assert (lab.read(f"{network}.wrcd-saved"), lab.read(f"{network}.wrcd-saved-2")) == ("first", "second")


@pytest.mark.parametrize("edited", [False, True])
def test_unit_that_is_no_longer_asked_for_is_disabled(lab: Lab, edited: bool) -> None:
    rig, link = f"{LOCAL.units}/sim-ecu@.service", LINK.replace("wrcd@can0", "sim-ecu@vcan0")
    lab.install("--with", "rig")
    lab.link(link, f"/{rig}")
    lab.link(LINK, f"/{UNIT}")
    if edited:
        lab.edit(rig)
    said = lab.install("--without", "rig")
    assert f"disabled   /{link}" in said
    assert not os.path.lexists(lab.path(link))
    assert str(lab.path(LINK).readlink()) == f"/{UNIT}"
    assert os.path.lexists(lab.path(rig)) is False


def test_unit_of_0_1_0_that_is_not_asked_for_is_disabled(lab: Lab) -> None:
    lab.by_hand()
    link = LINK.replace("wrcd@can0", "sim-ecu@vcan0")
    lab.link(link, "/etc/systemd/system/sim-ecu@.service")
    lab.install("--without", "rig")
    assert not os.path.lexists(lab.path(link).parent)


@pytest.mark.parametrize("kind", ["dangling", "folder"])
def test_environment_file_that_cannot_be_read_is_a_mistake(lab: Lab, kind: str) -> None:
    """Its unit would start without the configuration that somebody meant."""
    file = lab.path("etc/wrcd/can0.env")
    if kind == "dangling":
        lab.link("etc/wrcd/can0.env", "nowhere")
    else:
        file.mkdir(parents=True)
    error = lab.refused()
    assert f"{file}: cannot be read: " in error
    assert "(wrcd@can0)" in error
    assert "nothing was changed" in error
    lab.install("--force")


def test_file_that_is_no_longer_shipped_is_removed_an_edited_one_is_renamed(lab: Lab) -> None:
    lab.install("--with", "can0", "--with", "realtime")
    network, dropin = "etc/systemd/network/80-can0.network", f"{LOCAL.units}/wrcd@.service.d/realtime.conf"
    lab.edit(network)
    edited = lab.read(network)
    said = lab.install("--without", "can0", "--without", "realtime")
    assert f"saved      /{network}: edited here: renamed to 80-can0.network.wrcd-saved" in said
    assert f"removed    /{dropin}" in said
    assert lab.read(f"{network}.wrcd-saved") == edited
    assert not lab.path(dropin).exists()


def test_administrators_own_network_file_is_left_alone(lab: Lab) -> None:
    network = "etc/systemd/network/80-can0.network"
    lab.write(network, "[Match]\nName=can0\n[CAN]\nBitRate=250K\n")
    lab.install()
    assert lab.read(network).endswith("BitRate=250K\n")
    said = lab.install("--with", "can0")
    assert lab.read(network).endswith("BitRate=250K\n")
    assert f"kept       /{network}: edited here; the new one is" in said
    lab.uninstall()
    assert lab.files() == [network]


def test_program_of_the_same_name_is_left_alone(lab: Lab) -> None:
    lab.write("usr/local/bin/wrcd", "#!/bin/sh\n")
    assert "kept       /usr/local/bin/wrcd: not installed by wrcd\n" in lab.install()
    assert lab.read("usr/local/bin/wrcd") == "#!/bin/sh\n"
    lab.uninstall()
    assert lab.files() == ["usr/local/bin/wrcd"]


def test_only_units_and_program_ask_for_a_restart(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their time in the record is what a running unit's start is compared with."""
    times = iter(range(100))
    monkeypatch.setattr("wrcd.tools.install.run._moment", lambda live: ("boot", next(times)))
    changed = []
    for words, program in (
        ([], PROGRAM), ([], PROGRAM), (["--with", "can0"], PROGRAM), (["--with", "realtime"], PROGRAM),
        (["--without", "can0"], PROGRAM), ([], "/opt/wrcd-9/bin/wrcd"),
    ):  # fmt: skip
        lab.install(*words, program=program)
        changed.append(lab.manifest()["changed_us"])
    assert changed == [0, 0, 0, 1, 1, 2]


def test_missing_file_is_put_back(lab: Lab) -> None:
    lab.install()
    lab.path(UNIT).unlink()
    assert f"new        /{UNIT}: was missing" in lab.install()
    assert lab.path(UNIT).exists()


def test_installation_that_was_cut_off_is_completed_by_the_next(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever file it was at: the next one ends as if nothing had been, and knows all files as its own."""
    lab.by_hand()
    write, cut_offs = Tree.write, 0
    for last in range(20):
        written = 0

        def write_some(tree: Tree, name: str, laid: Laid, last: int = last) -> None:
            nonlocal written
            written += 1
            if written > last:
                raise CutOff
            write(tree, name, laid)

        monkeypatch.setattr(Tree, "write", write_some)
        try:
            lab.install("--with", "realtime")
            break
        except CutOff:
            cut_offs += 1
        monkeypatch.setattr(Tree, "write", write)
        lab.install("--with", "realtime")
        assert f"removed    {len(lab.manifest()['files'])} files" in lab.uninstall()
        assert lab.files() == []
        lab.by_hand()
    assert cut_offs >= 10


def test_configuration_that_no_longer_holds_stops_the_installation_before_it_changes_anything(lab: Lab) -> None:
    lab.write("etc/wrcd/can0.toml", DEFAULT + "[limits]\nmin_sped_m_s = 3\n")
    lab.write("etc/wrcd/can0.env", "WRCD_OPTIONS=--config /etc/wrcd/can0.toml\n")
    lab.write("etc/wrcd/can1.toml", DEFAULT)
    before = lab.snapshot()
    error = lab.refused()
    assert lab.snapshot() == before
    assert "did you mean 'min_speed_m_s'?" in error
    assert "(wrcd@can0)" in error
    assert f"does not hold with wrcd {__version__}: {lab.path('etc/wrcd/can0.toml')}; nothing was changed" in error
    assert "nothing was changed" in lab.refused("--dry-run")
    said = lab.install("--force")
    assert f"holds      {lab.path('etc/wrcd/can1.toml')}\n" in said
    assert lab.path(UNIT).exists()
    assert lab.read("etc/wrcd/can1.toml") == DEFAULT


def test_scenario_of_the_rig_is_not_taken_for_a_configuration(lab: Lab) -> None:
    lab.write("etc/wrcd/play.toml", "duration_s = 3\n")
    lab.write("etc/wrcd/sim-ecu-vcan0.env", "SCENARIO=/etc/wrcd/play.toml\n")
    lab.install()


def test_configuration_elsewhere_is_checked_where_a_unit_names_it(lab: Lab) -> None:
    lab.write("srv/train.toml", "[axles]\n")
    lab.write("etc/wrcd/can0.env", 'WRCD_OPTIONS="--config=/srv/train.toml"\n')
    assert str(lab.path("srv/train.toml")) in lab.refused()


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("bin/wrcd", "must be the absolute path"),
        ("/opt/x/../wrcd", "must be the absolute path"),
        ("/opt/python", "must be the absolute path"),
        ("/opt/my train/wrcd", "cannot name this path"),
        ("/opt/50%/wrcd", "cannot name this path"),
        ("/home/me/venv/bin/wrcd", "hides /home"),
        ("/root/venv/bin/wrcd", "hides /root"),
        ("/tmp/venv/bin/wrcd", "hides /tmp"),
    ],
)
def test_program_that_units_cannot_start_is_refused(lab: Lab, program: str, reason: str) -> None:
    assert reason in lab.refused(program=program)
    assert lab.files() == []


def test_computer_with_the_debian_package_is_refused(lab: Lab) -> None:
    lab.write(f"{DEBIAN.units}/wrcd@.service", "")
    assert "the Debian package wrcd is installed" in lab.refused()


@pytest.mark.parametrize("text", ["", "[]", '{"format": "wrcd-installed/9"}', '{"format": "wrcd-installed/1", "x": 1}'])
def test_record_that_cannot_be_read_is_refused(lab: Lab, text: str) -> None:
    lab.write(MANIFEST, text)
    assert "use that one" in lab.refused()


def test_record_that_names_a_path_outside_is_refused(lab: Lab) -> None:
    lab.install()
    record = json.loads(lab.read(MANIFEST))
    record["files"]["../../etc/passwd"] = ["0" * 64]
    lab.write(MANIFEST, json.dumps(record))
    assert "names a path that is none below the root" in lab.refused()


def test_units_of_the_repository_name_the_place_that_is_replaced() -> None:
    assert f"ExecStart={BUILT_FOR}/wrcd run" in (DATA / "wrcd@.service").read_text()
    assert f"ExecStart={BUILT_FOR}/sim-ecu play" in (DATA / "sim-ecu@.service").read_text()
