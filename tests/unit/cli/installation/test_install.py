"""`wrcd install` below a folder: what is laid out, taken over, kept and named."""

import gzip
import json
import os
import shutil
from pathlib import Path, PurePosixPath

import pytest

from tests.unit.cli.installation.lab import DATA, PROGRAM, UNIT, Lab
from wrcd import __version__
from wrcd.cli.installation.lay_out import DEBIAN, GROUPS, LOCAL, Laid, Places, lay_out
from wrcd.cli.installation.tree import RECORD, Tree
from wrcd.config.config import DEFAULT

SYSCTL = "etc/sysctl.d/80-wrcd.conf"
LINK = "etc/systemd/system/multi-user.target.wants/wrcd@can0.service"


class CutOff(BaseException):
    """The power fails."""


def test_units_start_the_program_that_is_installing(lab: Lab) -> None:
    lab.install("--with", "rig", program="/srv/wrcd-9/bin/wrcd")
    unit = lab.read(UNIT)
    assert "\nExecStart=/srv/wrcd-9/bin/wrcd run " in unit
    assert "\nExecReload=/usr/bin/nice -n 29 /srv/wrcd-9/bin/wrcd reload " in unit
    assert "/opt/wrcd" not in unit
    assert "\nExecStart=/srv/wrcd-9/bin/sim-ecu play " in lab.read(f"{LOCAL.units}/sim-ecu@.service")
    assert str(lab.path("usr/local/bin/wrcd").readlink()) == "/srv/wrcd-9/bin/wrcd"


def test_every_file_of_systemd_is_package_data_but_the_debian_packages_scripts() -> None:
    files = {p.relative_to(DATA) for p in DATA.rglob("*") if p.is_file()}
    systemd = Path(__file__).parents[4] / "systemd"
    own = {p.relative_to(systemd) for p in systemd.rglob("*") if p.is_file()}
    assert files == {p for p in own if p.parts[0] != "deb"}
    assert all((DATA / f).read_bytes() == (systemd / f).read_bytes() for f in files)


@pytest.mark.parametrize("layout", [LOCAL, DEBIAN], ids=["local", "debian"])
def test_nothing_harmful_is_laid_out_without_being_asked_for(layout: Places) -> None:
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


def test_second_installation_changes_nothing(lab: Lab) -> None:
    lab.install("--with", "can0")
    before = lab.snapshot()
    said = lab.install()
    assert lab.snapshot() == before
    assert f"wrcd {__version__} is installed; units start {PROGRAM}; with can0\n" in said
    assert lab.words(said) == ["unchanged"]


def test_dry_run_says_the_same_and_changes_nothing(lab: Lab, tmp_path: Path) -> None:
    lab.install(data=lab.older(tmp_path))
    lab.edit(UNIT)
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


@pytest.mark.parametrize("others", [False, True])
def test_edited_file_is_not_overwritten_by_an_upgrade(lab: Lab, tmp_path: Path, others: bool) -> None:
    """The new one lies beside it, once, not over another's file; when the edited one is as the new one, that goes."""
    lab.install(data=lab.older(tmp_path))
    lab.edit(UNIT)
    edited = lab.read(UNIT)
    if others:
        lab.write(f"{UNIT}.wrcd-new", "mine")
    new = f"{UNIT}.wrcd-new{'-2' if others else ''}"
    assert f"kept       /{UNIT}: edited here; the new one is {Path(new).name}" in lab.install()
    assert lab.read(UNIT) == edited
    assert f"ExecStart={PROGRAM} run" in lab.read(new)
    before = lab.snapshot()
    assert lab.words(lab.install()) == ["kept", "unchanged"]
    assert lab.snapshot() == before
    lab.path(UNIT).write_bytes(lab.path(new).read_bytes())
    lab.install()
    assert not lab.path(new).exists()
    lab.uninstall()
    assert lab.files() == ([f"{UNIT}.wrcd-new"] if others else [])


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


@pytest.mark.parametrize(
    ("name", "said"),
    [("etc/systemd/network/80-can0.network", "; the new one is"), ("usr/local/bin/wrcd", "\n")],
)
def test_administrators_own_file_is_left_alone(lab: Lab, name: str, said: str) -> None:
    lab.write(name, "mine")
    assert f"kept       /{name}: not installed by wrcd{said}" in lab.install("--with", "can0")
    assert lab.read(name) == "mine"
    lab.uninstall()
    assert lab.files() == [name]


def test_only_units_and_program_ask_for_a_restart(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their time in the record is what a running unit's start is compared with."""
    times = iter(range(100))
    monkeypatch.setattr("wrcd.cli.install._moment", lambda live: ("boot", next(times)))
    changed = []
    for words, program in (
        ([], PROGRAM), ([], PROGRAM), (["--with", "can0"], PROGRAM), (["--with", "realtime"], PROGRAM),
        (["--without", "can0"], PROGRAM), ([], "/opt/wrcd-9/bin/wrcd"),
    ):  # fmt: skip
        lab.install(*words, program=program)
        changed.append(lab.manifest()["changed_us"])
    assert changed == [0, 0, 0, 1, 1, 2]


def test_installation_that_was_cut_off_is_completed_by_the_next(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever file it was at: the next one ends as if nothing had been, and knows all files as its own."""
    write, cut_offs = Tree.write, 0
    for last in range(0, 20, 3):
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
    assert cut_offs >= 4


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


def test_configuration_elsewhere_is_checked_where_a_unit_names_it_and_the_rigs_scenario_is_none(lab: Lab) -> None:
    lab.write("etc/wrcd/play.toml", "duration_s = 3\n")
    lab.write("etc/wrcd/sim-ecu-vcan0.env", "SCENARIO=/etc/wrcd/play.toml\n")
    lab.install()
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
    lab.write(RECORD, text)
    assert "use that one" in lab.refused()


def test_record_that_names_a_path_outside_is_refused(lab: Lab) -> None:
    lab.install()
    record = json.loads(lab.read(RECORD))
    record["files"]["../../etc/passwd"] = ["0" * 64]
    lab.write(RECORD, json.dumps(record))
    assert "names a path that is none below the root" in lab.refused()
