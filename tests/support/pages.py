"""The pages of the documentation, and the shell blocks that stand in them."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
_BLOCK = re.compile(
    r"^(?: *<!-- skip: (?P<skip>.+?) -->\n)?(?P<indent> *)```sh\n(?P<body>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True, slots=True)
class Block:
    """One fence of kind sh: its page, its first line's number, its text, and why no test of the pages runs it."""

    page: Path
    line: int
    body: str
    skip: str | None

    @property
    def name(self) -> str:
        """Page and line, for a person."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    @property
    def commands(self) -> list[str]:
        """Each as one types it, without its comment."""
        joined = self.body.replace("\\\n", " ").splitlines()
        return [words for line in joined if (words := re.sub(r"(?:^|\s+)#.*", "", line).strip())]


def pages() -> list[Path]:
    """Every page of the project but the changelog."""
    found = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md")), *sorted(ROOT.glob("examples/*.md"))]
    return [page for page in found if page.name != "CHANGELOG.md"]


def blocks(page: Path) -> list[Block]:
    """Every shell block of a page, in order."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            page,
            text.count("\n", 0, m.start("body")) + 1,
            re.sub(rf"^{m['indent']}", "", m["body"], flags=re.MULTILINE),
            m["skip"],
        )
        for m in _BLOCK.finditer(text)
    ]


def run_by(file: str, page: str) -> list[Block]:
    """The blocks of a page that another test runs: `<!-- skip: FILE runs it -->` stands above them."""
    return [block for block in blocks(ROOT / page) if block.skip == f"{file} runs it"]
