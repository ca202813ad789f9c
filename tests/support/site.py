"""The site of the pages, as `make docs` builds it: without a warning, and with links that lead somewhere.

python -m tests.support.site FOLDER   builds it there and prints what is wrong; exit 1 if anything is
"""

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from tests.support.pages import ROOT

TIMEOUT_S = 300


class _Page(HTMLParser):
    """What a page of the site names: anchors, and where its links and pictures lead."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.targets: list[str] = []
        self.fetched: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note its id, href and src."""
        found = {name: value for name, value in attrs if value}
        if "id" in found:
            self.anchors.add(found["id"])
        self.targets += [found[name] for name in ("href", "src") if name in found]
        if tag in ("img", "script", "link", "iframe", "source"):
            self.fetched += [found[name] for name in ("href", "src") if name in found]


def build(folder: Path) -> str:
    """Build the site and return what Sphinx has to complain of, warnings too; nothing if it is content."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-n", "-E", "-c", "docs", ".", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    return done.stderr + (f"sphinx ended with {done.returncode}" if done.returncode else "")


def broken(folder: Path) -> list[str]:
    """Each link, anchor and picture of the site that leads nowhere, and what a browser would fetch from elsewhere."""
    pages = {p.resolve(): _Page(p.read_text(encoding="utf-8")) for p in sorted(folder.rglob("*.html"))}
    wrong = []
    for path, page in pages.items():
        name = path.relative_to(folder.resolve())
        wrong += [f"{name}: fetches {t}" for t in page.fetched if urlsplit(t).netloc]
        for target in page.targets:
            url = urlsplit(target)
            if url.scheme or url.netloc:
                continue
            to = (path.parent / unquote(url.path)).resolve() if url.path else path
            if not to.is_file() or (url.fragment and to in pages and unquote(url.fragment) not in pages[to].anchors):
                wrong.append(f"{name}: {target}")
    return wrong


def main() -> int:
    """Build and judge."""
    folder = Path(sys.argv[1])
    said = build(folder)
    wrong = broken(folder) if folder.exists() else []
    print(said + "\n".join(wrong), file=sys.stderr, end="\n" if wrong else "")
    return 1 if said or wrong else 0


if __name__ == "__main__":
    sys.exit(main())
