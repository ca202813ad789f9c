"""Build the Debian package: the program with the libraries that it was tested with in /opt/wrcd, and its units.

Needs dpkg-deb, gcc and the system's python3, no root. The same tree and SOURCE_DATE_EPOCH give the same bytes.
"""

import argparse
import gzip
import hashlib
import os
import shutil
import subprocess
import sys
from email.utils import formatdate
from pathlib import Path, PurePosixPath

from wrcd import __version__, resources
from wrcd.cli.installation.lay_out import CONFIGURATIONS, DEBIAN, lay_out

ROOT = Path(__file__).parents[2]
PYTHON = "/usr/bin/python3"
HOME = PurePosixPath("/opt/wrcd")
SCRIPTS = ("preinst", "postinst", "prerm", "postrm")
MAINTAINER = "the wrcd maintainers <wrcd@users.noreply.github.com>"
ENTRY = """#!{home}/bin/python
import sys

from {module} import main

sys.exit(main())
"""
CONTROL = """Package: wrcd
Version: {version}
Architecture: {architecture}
Maintainer: {maintainer}
Installed-Size: {size}
Depends: python{python}, libc6 (>= 2.29), libgcc-s1, libstdc++6, systemd
Section: misc
Priority: optional
Description: wheel-rail condition daemon: available adhesion on the CAN bus
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
    parser.add_argument("--version", default=__version__, help="call it so: a test's package to upgrade from")
    parser.add_argument("--systemd", type=Path, metavar="DIR", help="unit files instead of the package's: the same")
    args = parser.parse_args()
    os.environ.setdefault("SOURCE_DATE_EPOCH", _commit_time())
    args.output.mkdir(parents=True, exist_ok=True)
    site = args.site or args.output / "site"
    if not args.site:
        subprocess.run([ROOT / "systemd/deb/site", site], check=True)
    tree = args.output / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    python = _output(PYTHON, "-c", "import sys; print('%d.%d' % sys.version_info[:2])")
    _program(tree, site, python, args.version)
    conffiles = _system(tree, args.systemd)
    _documents(tree, args.version)
    _modes_and_times(tree)
    _compile(tree, python)
    _modes_and_times(tree)
    package = args.output / f"wrcd_{args.version}_{_output('dpkg', '--print-architecture')}.deb"
    _control(tree, conffiles, args.version, python)
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


def _program(tree: Path, site: Path, python: str, version: str) -> None:
    """A virtual environment of the system's python, with what systemd/deb/site laid out."""
    home = tree / str(HOME).lstrip("/")
    packages = home / f"lib/python{python}/site-packages"
    shutil.copytree(site, packages, ignore=shutil.ignore_patterns("__pycache__", "tests"))
    shutil.rmtree(packages / "bin", ignore_errors=True)
    if not [*(packages / "wrcd").glob("_native*.so")]:
        raise SystemExit(f"{site} has no compiled estimator: install gcc and libc6-dev, and build it again")
    (packages / "wrcd/__init__.py").write_text(
        (packages / "wrcd/__init__.py").read_text().replace(f'"{__version__}"', f'"{version}"')
    )
    (home / "bin").mkdir()
    (home / "bin" / f"python{python}").symlink_to(f"/usr/bin/python{python}")
    (home / "bin/python3").symlink_to(f"python{python}")
    (home / "bin/python").symlink_to(f"python{python}")
    # no sim-ecu: the packages that it needs are no part of this one
    (home / "bin/wrcd").write_text(ENTRY.format(home=HOME, module="wrcd.cli.main"))
    (home / "pyvenv.cfg").write_text("home = /usr/bin\ninclude-system-site-packages = false\n")


def _system(tree: Path, systemd: Path | None) -> list[str]:
    """Units and all else that `wrcd install` lays out, too. Returns the configuration files among them."""
    laid = lay_out(DEBIAN, HOME / "bin/wrcd", data=resources.DATA, systemd=systemd)
    for name, file in laid.items():
        path = tree / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if file.target:
            path.symlink_to(file.target)
        else:
            path.write_bytes(file.content)
    (tree / CONFIGURATIONS).mkdir(parents=True, exist_ok=True)
    return sorted(f"/{name}" for name in laid if name.startswith("etc/"))


def _documents(tree: Path, version: str) -> None:
    folder = tree / "usr/share/doc/wrcd"
    (folder / "copyright").write_text(COPYRIGHT + _indented((ROOT / "LICENSE").read_text()))
    date = formatdate(int(os.environ["SOURCE_DATE_EPOCH"]))
    entry = f"wrcd ({version}) unstable; urgency=medium\n\n  * As CHANGELOG.md says.\n\n -- {MAINTAINER}  {date}\n"
    (folder / "changelog.gz").write_bytes(gzip.compress(entry.encode(), 9, mtime=0))
    (folder / "NEWS.gz").write_bytes(gzip.compress((ROOT / "CHANGELOG.md").read_bytes(), 9, mtime=0))
    overrides = tree / "usr/share/lintian/overrides"
    overrides.mkdir(parents=True)
    shutil.copy(ROOT / "systemd/deb/lintian-overrides", overrides / "wrcd")


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
         "/", tree / str(HOME).lstrip("/") / "lib"],
        check=True, env={**os.environ, "PYTHONHASHSEED": "0"},
    )  # fmt: skip


def _control(tree: Path, conffiles: list[str], version: str, python: str) -> None:
    files = sorted(p for p in tree.rglob("*") if p.is_file() and not p.is_symlink())
    control = tree / "DEBIAN"
    control.mkdir()
    control.chmod(0o755)
    (control / "control").write_text(
        CONTROL.format(
            version=version, architecture=_output("dpkg", "--print-architecture"), maintainer=MAINTAINER, python=python,
            size=sum(-(-p.stat().st_size // 1024) for p in files),
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
