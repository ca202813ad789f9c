"""A browser of the walk's own: Debian's chromium without a window, driven by playwright."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from tests.walk.walk import StepFailed, Walk

CHROMIUM = "/usr/bin/chromium"
# No GPU, no sandbox of its own (root has none), nothing fetched behind the page's back.
OPTIONS = (
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
WIDE, NARROW = (1200, 900), (400, 900)


class Browser:
    """Opens pages, and keeps what they complain of."""

    def __init__(self, page: Page, walk: Walk) -> None:
        self.page, self._walk = page, walk
        self.complaints: list[str] = []
        page.on("console", lambda m: self.complaints.append(f"{m.type}: {m.text}") if m.type != "log" else None)
        page.on("pageerror", lambda e: self.complaints.append(f"error: {e}"))
        page.on("requestfailed", lambda r: self.complaints.append(f"not loaded: {r.url[:100]}"))
        page.on("request", self._is_local)

    def _is_local(self, request: object) -> None:
        url = str(getattr(request, "url", ""))
        if not url.startswith(("file:", "data:", "blob:")):
            self.complaints.append(f"asks the network for {url[:100]}")

    def open(self, path: Path, seconds: float = 30.0) -> None:
        """Open a file, and wait until it has loaded."""
        self.page.goto(path.as_uri(), timeout=seconds * 1000, wait_until="load")

    def resize(self, size: tuple[int, int]) -> None:
        """Give the window another size, and let the page follow."""
        self.page.set_viewport_size({"width": size[0], "height": size[1]})
        self.page.wait_for_timeout(500)

    def overflow_px(self) -> int:
        """By how much the page is wider than its window: a reader would have to scroll sideways."""
        return int(self.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))

    def keep(self, name: str, whole: bool = False) -> Path:
        """A picture of the window, or of the whole page, in the folder of pictures."""
        path = self._walk.out / f"{name}.png"
        self.page.screenshot(path=path, full_page=whole)
        return path

    def quiet(self) -> None:
        """Fail the step if the page has complained, or has asked for something beyond its file."""
        if self.complaints:
            raise StepFailed("the page complains:\n" + "\n".join(self.complaints))


@contextmanager
def browser(walk: Walk, size: tuple[int, int] = WIDE) -> Iterator[Browser]:
    """A browser for the length of a block."""
    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=list(OPTIONS))
        try:
            page = chromium.new_page(viewport={"width": size[0], "height": size[1]})
            yield Browser(page, walk)
        finally:
            chromium.close()
