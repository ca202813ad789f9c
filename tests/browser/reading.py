"""What a page shows, read from it."""

import re

from playwright.sync_api import Page

VIEW = """const place = document.querySelector(`figure[data-plot="${key}"] .plot`);
const view = [...Bokeh.index.roots].find((v) => place.contains(v.el));"""


def settle(page: Page) -> None:
    """Wait for some frames: what was asked for is drawn then."""
    page.evaluate(
        "new Promise((done) => { let n = 4; const next = () => n-- ? requestAnimationFrame(next) : done(); next(); })"
    )


def plot(page: Page, key: str) -> dict[str, float]:
    """Where a plot is, once it is scrolled into view and drawn."""
    place = page.locator(f'figure[data-plot="{key}"] .plot')
    place.scroll_into_view_if_needed()
    page.wait_for_timeout(100)  # the browser tells what is in view once a frame
    settle(page)
    box = place.bounding_box()
    assert box is not None
    return {"x": box["x"], "y": box["y"], "width": box["width"], "height": box["height"]}


def range_of(page: Page, key: str) -> list[float]:
    """What a plot's axis shows."""
    found: list[float] = page.evaluate(
        f"(key) => {{ {VIEW} const r = view.model.x_range; return [r.start, r.end]; }}", key
    )
    return found


def frame(page: Page, key: str) -> tuple[float, float]:
    """Left edge and width of a plot's frame, pixels from the plot's own left edge."""
    left, width = page.evaluate(f"(key) => {{ {VIEW} const b = view.frame.bbox; return [b.left, b.width]; }}", key)
    return left, width


def curves(page: Page, key: str) -> list[list[float]]:
    """The y that each curve of a plot draws; NaN is left out."""
    found: list[list[float]] = page.evaluate(
        f"(key) => {{ {VIEW} return view.model.renderers.map("
        "(r) => [...(r.data_source.data.y ?? [])].filter(Number.isFinite)); }",
        key,
    )
    return found


def corner(page: Page, key: str) -> list[int]:
    """Red, green and blue in a corner of a plot's frame."""
    found: list[int] = page.evaluate(
        f"""(key) => {{ {VIEW} const b = view.frame.bbox;
        const context = view.export("png").canvas.getContext("2d");
        return [...context.getImageData(b.left + 3, b.top + 2, 1, 1).data.slice(0, 3)]; }}""",
        key,
    )
    return found


def shown_range(page: Page) -> tuple[float, float]:
    """Seconds in view, as the panel says them."""
    found = re.findall(r"([\d.]+) s", page.locator("#range").inner_text())
    return float(found[0]), float(found[1])


def moment(page: Page) -> float:
    """Seconds of the cursor, as the panel says them."""
    return float(page.locator("#moment").inner_text().split(" s")[0])


def chips(page: Page, key: str) -> list[str]:
    """A plot's legend with the values at the cursor."""
    return page.locator(f'figure[data-plot="{key}"] .chip').all_inner_texts()
