"""A headless chromium that ends with its test, and pages that must not complain."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

PATH = shutil.which("chromium")
QUIET = (
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
TIMEOUT_MS = 60_000  # of any one step


@contextmanager
def chromium() -> Iterator[Browser]:
    """Start one of its own, and end it."""
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=PATH, args=list(QUIET), timeout=TIMEOUT_MS)
        try:
            yield browser
        finally:
            browser.close()


@dataclass
class Opened:
    """A page and what it complained about: errors and warnings of the console, requests that leave the file."""

    page: Page
    complaints: list[str] = field(default_factory=list)

    def listen(self) -> None:
        """From before it is loaded."""
        self.page.on("console", lambda m: self._said(m.type, m.text))
        self.page.on("pageerror", lambda e: self.complaints.append(f"error: {e}"))
        self.page.on("request", lambda r: self._asked(r.url))

    def settle(self) -> None:
        """Wait for some frames: what was asked for is drawn then."""
        self.page.evaluate(
            "new Promise((done) => { let n = 4; const next = () => (n-- ? requestAnimationFrame(next) : done()); "
            "next(); })"
        )

    def _said(self, kind: str, text: str) -> None:
        if kind in ("error", "warning"):
            self.complaints.append(f"{kind}: {text}")

    def _asked(self, url: str) -> None:
        if not url.startswith(("file:", "data:", "blob:")):
            self.complaints.append(f"request: {url}")


@contextmanager
def opened(browser: Browser, file: Path, width: int = 1280, height: int = 900) -> Iterator[Opened]:
    """Open a report, and wait until its plots are drawn."""
    context = browser.new_context(viewport={"width": width, "height": height}, reduced_motion="reduce")
    try:
        context.set_default_timeout(TIMEOUT_MS)
        found = Opened(context.new_page())
        found.listen()
        found.page.goto(file.resolve().as_uri())
        found.page.wait_for_selector("html[data-state=complete]", state="attached")
        yield found
    finally:
        context.close()
