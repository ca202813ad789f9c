"""A headless chromium that ends with its test, and pages that must not complain."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, Page, sync_playwright

PATH = os.environ.get("CHROMIUM", "/usr/bin/chromium")
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

    def _said(self, kind: str, text: str) -> None:
        if kind in ("error", "warning"):
            self.complaints.append(f"{kind}: {text}")

    def _asked(self, url: str) -> None:
        if not url.startswith(("file:", "data:", "blob:")):
            self.complaints.append(f"request: {url}")


@contextmanager
def opened(
    browser: Browser, file: Path, width: int = 1280, height: int = 900, scheme: Literal["light", "dark"] = "light",
    script: str = "", until: str = "complete",
) -> Iterator[Opened]:  # fmt: skip
    """Open a report, and wait until its plots are drawn: "shown" those in view, "complete" all."""
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme, reduced_motion="reduce"
    )
    try:
        context.set_default_timeout(TIMEOUT_MS)
        if script:
            context.add_init_script(script)
        found = Opened(context.new_page())
        found.listen()
        found.page.goto(file.resolve().as_uri())
        if until:
            states = ("complete",) if until == "complete" else ("shown", "complete")
            found.page.wait_for_selector(",".join(f"html[data-state={s}]" for s in states), state="attached")
        yield found
    finally:
        context.close()
