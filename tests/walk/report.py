"""Report: `wrcd report` of the demo's log, read in a browser: zoom, cursor, wide and narrow, light and dark."""

import re

from tests.walk.browser import NARROW, Browser, browser
from tests.walk.walk import Step, Walk, expect, played

MAX_MB = 10.0


def take(walk: Walk) -> str:
    """Write the report, open it, do what a reader does, take its pictures."""
    walk.wrcd("report", played(walk), "-o", "report.html")
    path = walk.folder / "report.html"
    size_mb = path.stat().st_size / 1e6
    expect(size_mb <= MAX_MB, f"report.html has {size_mb:.1f} MB")
    with browser(walk) as b:
        b.open(path)
        b.page.wait_for_selector("html[data-state=complete]", state="attached", timeout=60_000)
        paint_ms = b.page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
        verdict = b.page.inner_text(".findings").strip()
        expect(len(verdict) > 20, f"the verdict is {verdict!r}")
        b.keep("report-1200")
        values = _cursor(b)
        zoomed = _zoom(b)
        for name, what in (("report-1200-whole", "1200 px"), ("report-400", "400 px")):
            b.resize(NARROW if "400" in name else (1200, 900))
            expect(b.overflow_px() <= 0, f"at {what} the page is {b.overflow_px()} px wider than its window")
            b.keep(name, whole=True)
        b.page.emulate_media(color_scheme="dark")
        b.page.wait_for_timeout(500)
        brightness = b.page.evaluate(BRIGHTNESS)
        expect(brightness < 80, f"in the dark the background has a brightness of {brightness} of 255")
        b.resize((1200, 900))
        b.keep("report-dark")
        b.quiet()
    return (
        f"{size_mb:.1f} MB, first paint {paint_ms:.0f} ms, no complaint; cursor: {values}; zoom: {zoomed}; 1200 and "
        "400 px wide, dark"
    )


# of the background that is seen behind the page's text
BRIGHTNESS = """() => {
    for (let e = document.querySelector('h1'); e; e = e.parentElement) {
        const [r, g, b, a = 1] = getComputedStyle(e).backgroundColor.match(/[\\d.]+/g).map(Number);
        if (a > 0) return (r + g + b) / 3;
    }
    return 255;
}"""


def _cursor(b: Browser) -> str:
    """Move over the first plot: the moment and what is said there follow."""
    plot = b.page.locator("figure[data-plot]").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    expect(box is not None, "there is no plot")
    said = set()
    for share in (0.4, 0.8):
        assert box is not None
        b.page.mouse.move(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
        b.page.wait_for_timeout(300)
        said.add((b.page.inner_text("#moment"), b.page.inner_text("#explanation")))
    expect(len(said) == 2, f"the cursor says the same at two places: {said}")
    for moment, explanation in said:
        expect(re.search(r"\d", moment) is not None, f"the cursor's moment is {moment!r}")
        expect(re.search(r"\d+(\.\d+)? ?%", explanation) is not None, f"no value at the cursor: {explanation!r}")
    return " and ".join(sorted(moment for moment, _ in said))


def _zoom(b: Browser) -> str:
    """Turn the wheel with Ctrl over a plot, then press Home: the range shrinks, and is whole again."""
    whole = b.page.inner_text("#range")
    b.page.keyboard.down("Control")
    for _ in range(4):
        b.page.mouse.wheel(0, -240)
        b.page.wait_for_timeout(50)
    b.page.keyboard.up("Control")
    b.page.wait_for_timeout(300)
    zoomed = b.page.inner_text("#range")
    expect(zoomed != whole, f"the wheel does not zoom: {whole!r}")
    b.keep("report-zoomed")
    b.page.keyboard.press("Home")
    b.page.wait_for_timeout(300)
    expect(b.page.inner_text("#range") == whole, "Home does not show the whole log")
    return f"{whole} to {zoomed}"


STEP = Step("report", take, (("chromium", "chromium"),))
