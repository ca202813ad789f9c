"""Build the Debian package: the program with the libraries that it was tested with in /opt/wrcd, and its units.

Needs dpkg-deb, a C compiler (`make deb` brings one) and the system's python3, no root. The same tree and
SOURCE_DATE_EPOCH give the same bytes.
"""

import argparse
import gzip
import hashlib
import os
import shutil
import subprocess
import sys
import textwrap
from datetime import UTC, datetime
from email.utils import formatdate
from pathlib import Path

import shtab
from docutils.core import publish_string

from wrcd import __version__
from wrcd.cli.main import WRCD

ROOT = Path(__file__).parents[2]
PYTHON = "/usr/bin/python3"
HOME = "/opt/wrcd"
EXAMPLES = "usr/share/doc/wrcd/examples"
# Where each file of systemd/ lies. A bit rate that is not the train's would do harm: what sets one is an example.
PLACES = {
    "wrcd@.service": "usr/lib/systemd/system",
    "80-wrcd.conf": "etc/sysctl.d",
    "80-can0.network": EXAMPLES,
    "80-vcan0.netdev": EXAMPLES,
    "80-vcan0.network": EXAMPLES,
    "wrcd@.service.d/realtime.conf": EXAMPLES,
    "wrcd@.service.d/device.conf": EXAMPLES,
}
SCRIPTS = ("preinst", "postinst", "prerm", "postrm")
# What somebody on the train looks up, where there is no network.
REFERENCE = ("configuration.md", "dbc.md", "messages.md", "validity.md", "exit-codes.md")
MAINTAINER = "the wrcd maintainers <wrcd@users.noreply.github.com>"
ENTRY = """#!{home}/bin/python
import sys

from {module} import main

sys.exit(main())
"""
SUMMARY = "wheel-rail condition daemon: available adhesion on the CAN bus"
CONTROL = """Package: wrcd
Version: {version}
Architecture: {architecture}
Maintainer: {maintainer}
Installed-Size: {size}
Depends: python{python}, libc6 (>= 2.29), libgcc-s1, libstdc++6, systemd
Section: misc
Priority: optional
Description: {summary}
 It reads yaw rate, lateral acceleration and torque of every wheelset from a CAN
 bus, and sends the adhesion that the rail offers, before the wheel slips.
 .
 Its libraries lie beside it in /opt/wrcd, in the versions that it was tested
 with. Simulation only: nothing of it has run on a train.
"""
COPYRIGHT = """Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: wrcd
Comment: The libraries below /opt/wrcd/lib have licences of their own, in their
 *.dist-info folders.

Files: *
Copyright: see below
License: MIT
"""


def main() -> int:
    """Build one package and print its path."""
    parser = argparse.ArgumentParser(description="Build the Debian package of wrcd.")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build/deb", metavar="DIR")
    parser.add_argument(
        "--site", type=Path, metavar="DIR", help="what systemd/deb/site has laid out before (default: anew)"
    )
    parser.add_argument("--compress", default="xz", choices=("xz", "gzip", "none"))
    args = parser.parse_args()
    os.environ.setdefault("SOURCE_DATE_EPOCH", _commit_time())
    args.output.mkdir(parents=True, exist_ok=True)
    site = args.site or args.output / "site"
    if not args.site:
        subprocess.run([ROOT / "systemd/deb/site", site], check=True)
    tree = args.output / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    python = _output(PYTHON, "-c", "import sys; print('%d.%d' % sys.version_info[:2])")
    _program(tree, site, python)
    _system(tree)
    _documents(tree)
    _manual_and_completion(tree)
    _modes_and_times(tree)
    _compile(tree, python)
    _modes_and_times(tree)
    package = args.output / f"wrcd_{__version__}_{_output('dpkg', '--print-architecture')}.deb"
    _control(tree, python)
    subprocess.run(
        ["dpkg-deb", "--root-owner-group", f"-Z{args.compress}", "--build", tree, package],
        check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    shutil.rmtree(tree)
    print(package)
    return 0


def _output(*words: str | Path) -> str:
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()


def _commit_time() -> str:
    """Seconds since 1970 of what is built: the last commit's, or the changelog's where there is no git."""
    try:
        return _output("git", "-C", ROOT, "log", "-1", "--format=%ct")
    except (OSError, subprocess.CalledProcessError):
        return str(int((ROOT / "CHANGELOG.md").stat().st_mtime))


def _program(tree: Path, site: Path, python: str) -> None:
    """A virtual environment of the system's python, with what systemd/deb/site laid out."""
    home = tree / HOME.lstrip("/")
    packages = home / f"lib/python{python}/site-packages"
    shutil.copytree(site, packages, ignore=shutil.ignore_patterns("__pycache__", "tests"))
    shutil.rmtree(packages / "bin", ignore_errors=True)
    if not (packages / "wrcd/_native.so").exists():
        raise SystemExit(f"{site} has no library in C: install gcc and libc6-dev, and build it again")
    (home / "bin").mkdir()
    (home / "bin" / f"python{python}").symlink_to(f"/usr/bin/python{python}")
    (home / "bin/python3").symlink_to(f"python{python}")
    (home / "bin/python").symlink_to(f"python{python}")
    # no sim-ecu: the packages that it needs are no part of this one
    (home / "bin/wrcd").write_text(ENTRY.format(home=HOME, module="wrcd.cli.main"))
    shutil.copy(ROOT / "systemd/deb/upgraded.py", home / "lib")
    (home / "pyvenv.cfg").write_text("home = /usr/bin\ninclude-system-site-packages = false\n")


def _system(tree: Path) -> None:
    """The files of systemd/, the program by its name, and a folder for configurations."""
    for name, place in PLACES.items():
        path = tree / place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "systemd" / name, path)
    (tree / "usr/bin").mkdir()
    (tree / "usr/bin/wrcd").symlink_to(f"{HOME}/bin/wrcd")
    (tree / "etc/wrcd").mkdir()


def _documents(tree: Path) -> None:
    folder = tree / "usr/share/doc/wrcd"
    (folder / "copyright").write_text(COPYRIGHT + _indented((ROOT / "LICENSE").read_text()))
    date = formatdate(int(os.environ["SOURCE_DATE_EPOCH"]))
    entry = f"wrcd ({__version__}) unstable; urgency=medium\n\n  * As CHANGELOG.md says.\n\n -- {MAINTAINER}  {date}\n"
    (folder / "changelog.gz").write_bytes(gzip.compress(entry.encode(), 9, mtime=0))
    (folder / "NEWS.gz").write_bytes(gzip.compress((ROOT / "CHANGELOG.md").read_bytes(), 9, mtime=0))
    sys.path.insert(0, str(ROOT / "docs"))
    from tables import with_tables

    for name in REFERENCE:
        (folder / name).write_text(with_tables((ROOT / "docs/reference" / name).read_text()))
    overrides = tree / "usr/share/lintian/overrides"
    overrides.mkdir(parents=True)
    shutil.copy(ROOT / "systemd/deb/lintian-overrides", overrides / "wrcd")


def _manual_and_completion(tree: Path) -> None:
    """What --help says, as wrcd(1) by Docutils, and completion for bash and zsh by shtab: made of the parsers."""
    parser = WRCD.parser()
    commands = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction)).choices
    for action in (a for command in commands.values() for a in command._actions):
        if action.type is Path:
            action.complete = shtab.FILE
    day = datetime.fromtimestamp(int(os.environ["SOURCE_DATE_EPOCH"]), UTC).date()
    rule = "-" * len(SUMMARY)
    page = f"====\nwrcd\n====\n\n{rule}\n{SUMMARY}\n{rule}\n\n"
    page += f":Manual section: 1\n:Date: {day}\n:Version: wrcd {__version__}\n\n"
    os.environ.update(COLUMNS="79", NO_COLOR="1")  # argparse's width and, from Python 3.14 on, colours
    os.environ.pop("FORCE_COLOR", None)
    for p in (parser, *commands.values()):
        page += f"{p.prog}\n{'=' * len(p.prog)}\n\n::\n\n{textwrap.indent(p.format_help(), '  ')}\n"
    alone = {"_disable_config": True}  # whatever docutils.conf the builder has
    made: dict[str, bytes] = {
        "man/man1/wrcd.1.gz": gzip.compress(
            publish_string(page, writer="manpage", settings_overrides=alone), 9, mtime=0
        ),
        "bash-completion/completions/wrcd": shtab.complete(parser, "bash").encode(),
        "zsh/vendor-completions/_wrcd": shtab.complete(parser, "zsh").encode(),
    }
    for name, content in made.items():
        path = tree / "usr/share" / name
        path.parent.mkdir(parents=True)
        path.write_bytes(content)


def _indented(text: str) -> str:
    """As a field of many lines in a file of Debian's form."""
    return "".join(f" {line}\n" if line.strip() else " .\n" for line in text.strip().splitlines())


def _modes_and_times(tree: Path) -> None:
    """Readable by everybody, executable where it is a program, and of one time, whatever the builder's umask is."""
    epoch = int(os.environ["SOURCE_DATE_EPOCH"])
    for path in sorted((tree, *tree.rglob("*")), reverse=True):
        if not path.is_symlink():
            path.chmod(0o755 if path.is_dir() or path.parent.name == "bin" else 0o644)
        os.utime(path, (epoch, epoch), follow_symlinks=False)


def _compile(tree: Path, python: str) -> None:
    """Byte code, as the daemon may not write it: it fits the times that the files have in the package."""
    subprocess.run(
        [f"/usr/bin/python{python}", "-m", "compileall", "-q", "--invalidation-mode", "timestamp", "-s", tree, "-p",
         "/", tree / HOME.lstrip("/") / "lib"],
        check=True, env={**os.environ, "PYTHONHASHSEED": "0"},
    )  # fmt: skip


def _control(tree: Path, python: str) -> None:
    files = sorted(p for p in tree.rglob("*") if p.is_file() and not p.is_symlink())
    conffiles = [f"/{p.relative_to(tree)}" for p in files if p.is_relative_to(tree / "etc")]
    control = tree / "DEBIAN"
    control.mkdir()
    control.chmod(0o755)
    (control / "control").write_text(
        CONTROL.format(
            version=__version__, summary=SUMMARY, architecture=_output("dpkg", "--print-architecture"),
            maintainer=MAINTAINER, python=python, size=sum(-(-p.stat().st_size // 1024) for p in files),
        )
    )  # fmt: skip
    (control / "conffiles").write_text("".join(f"{name}\n" for name in conffiles))
    sums = ((hashlib.md5(p.read_bytes()).hexdigest(), p.relative_to(tree)) for p in files)
    (control / "md5sums").write_text("".join(f"{s}  {n}\n" for s, n in sums if f"/{n}" not in conffiles))
    for name in SCRIPTS:
        shutil.copy(ROOT / "systemd/deb" / name, control / name)
        (control / name).chmod(0o755)
    for name in ("control", "conffiles", "md5sums"):
        (control / name).chmod(0o644)


if __name__ == "__main__":
    sys.exit(main())
