"""Install what a lock file names into this environment: `python tests/install.py LOCK`. By uv, else by pip.

uv takes a fifth of pip's time, but reads nothing of pip's configuration: where packages come from is asked of pip and
handed on. What is set for uv itself stays. The hashes of the lock file hold for both.
"""

import ast
import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from pip._vendor import certifi

PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")
UV = (str(Path(sys.executable).parent / "uv"), "pip")
# what says the same to uv, by the name of pip's setting
SETTINGS = {
    "index-url": "UV_DEFAULT_INDEX",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "trusted-host": "UV_INSECURE_HOST",
    "timeout": "UV_HTTP_TIMEOUT",
    "default-timeout": "UV_HTTP_TIMEOUT",
    "proxy": "ALL_PROXY",
    "cert": "SSL_CERT_FILE",
    "client-cert": "SSL_CLIENT_CERT",
}


def as_pip(listed: str) -> dict[str, str]:
    """The environment in which uv asks where pip does, from what `pip config list` prints."""
    # of several indexes pip takes the best version, uv that of the first
    found = {"SSL_CERT_FILE": certifi.where(), "UV_INDEX_STRATEGY": "unsafe-best-match"}
    for section in ("global.", "install.", ":env:."):  # the last counts, as for pip
        for line in listed.splitlines():
            name, _, value = line.partition("=")
            variable = SETTINGS.get(name.removeprefix(section))
            if name.startswith(section) and variable:
                # uv parts these at commas, all others at blanks, as pip does
                between = "," if variable == "UV_FIND_LINKS" else " "
                found[variable] = between.join(ast.literal_eval(value).split())
    return found


def parted(lock: str, package: str) -> tuple[str, str]:
    """The lines of one package of a lock file, and those of all others."""
    entries = re.split(r"^(?=\S)", lock, flags=re.MULTILINE)
    own = [e for e in entries if e.startswith(f"{package}==")]
    return "".join(own), "".join(e for e in entries if e not in own)


def main(file: Path) -> int:
    """Install the packages of the file. Returns the exit status of what did."""
    uv, others = parted(file.read_text(), "uv")
    scratch = Path(sys.prefix) / "install.lock"

    def by_pip(lines: str) -> int:
        scratch.write_text(lines)
        return subprocess.run([*PIP, "install", "-q", "--require-hashes", "-r", scratch], check=False).returncode

    if not uv or by_pip(uv) == 0:
        listed = subprocess.run([*PIP, "config", "list"], capture_output=True, text=True, check=True).stdout
        # compiled, as pip does: some may not write the byte code when they run
        words = (*UV, "install", "-q", "--compile-bytecode", "--require-hashes", "--python", sys.executable, "-r", file)
        with suppress(OSError):
            if subprocess.run(words, check=False, env={**as_pip(listed), **os.environ}).returncode == 0:
                return 0
    print(f"{file}: uv does not serve here; pip installs it instead", file=sys.stderr)
    return by_pip(others)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
