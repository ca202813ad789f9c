"""The site of these pages: Sphinx with MyST, its own theme. `make docs` builds it into build/site; nothing is fetched.

The pages are plain Markdown and read alike on a code host. The source folder is the repository's: README.md is the
front page, docs/README.md says what stands in the sidebar, and a link to a file of the repository gives that file.
"""

import re
import shutil
import sys
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))
from tables import with_tables  # noqa: E402  # Sphinx imports this file, not its folder

INDEX = "docs/README"

project = "wrcd"
author = "the wrcd contributors"
project_copyright = "the wrcd contributors, MIT licence"
_version = re.search(r'^__version__ = "(.+)"$', (ROOT / "wrcd/__init__.py").read_text(encoding="utf-8"), re.MULTILINE)
assert _version
release = version = _version[1]

extensions = ["myst_parser"]
root_doc = "README"
include_patterns = ["*.md", "docs/**.md", "examples/README.md"]
exclude_patterns = [".*", "build", "dist", "tests", "wrcd", "sim_ecu", "systemd", "*.egg-info"]
nitpicky = True
myst_heading_anchors = 4
myst_links_external_new_tab = False
suppress_warnings = ["myst.header"]  # a quoted score begins with a table, not with a heading of its own

html_theme = "alabaster"
html_theme_options = {"page_width": "1150px", "body_max_width": "none"}
html_title = f"wrcd {release}"
html_copy_source = False
html_show_sphinx = False
html_show_search_summary = False  # it fetches pages, which a browser does not let a file do
html_static_path = ["_static"]
html_css_files = ["site.css"]
pygments_style = "friendly"


def sections() -> list[tuple[str, list[str]]]:
    """Each section of the index with its pages, as Sphinx names them."""
    text = (ROOT / f"{INDEX}.md").read_text(encoding="utf-8")
    found = []
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        lines = re.findall(r"^- .+", part, re.MULTILINE)
        links = [link for line in lines for link in re.findall(r"\]\(([^)#]+)\.md\)", line)]
        pages = [(ROOT / INDEX).parent.joinpath(link).resolve().relative_to(ROOT).as_posix() for link in links]
        if pages:
            found.append((part.partition("\n")[0].strip(), pages))
    return found


def add_tables(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put tables of keys and of signals where a page names them."""
    source[0] = with_tables(source[0])


def add_sidebar(app: Sphinx, docname: str, source: list[str]) -> None:
    """Give the front page the tables of contents that the index says; Markdown of a code host has none."""
    if docname == root_doc:
        for caption, pages in (("", [INDEX]), *sections()):
            options = [":hidden:", *([f":caption: {caption}"] if caption else [])]
            source[0] += "\n".join(["\n```{toctree}", *options, "", *(f"/{page}" for page in pages), "```\n"])


def add_front_page(app: Sphinx, failed: Exception | None) -> None:
    """A folder's page is index.html."""
    if failed is None and app.builder.format == "html":
        shutil.copyfile(Path(app.outdir, f"{root_doc}.html"), Path(app.outdir, "index.html"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls it."""
    app.connect("source-read", add_sidebar)
    app.connect("source-read", add_tables)
    app.connect("build-finished", add_front_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
