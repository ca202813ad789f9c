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


def tick_labels(page: Page, key: str) -> list[tuple[float, float]]:
    """Left and right edge of each label of a plot's horizontal axis, in pixels."""
    found: list[tuple[float, float]] = page.evaluate(
        f"""(key) => {{ {VIEW} const axis = view.model.below[0], {{ start, end }} = view.model.x_range;
        const context = document.createElement("canvas").getContext("2d");
        context.font = `${{axis.major_label_text_font_size}} ${{axis.major_label_text_font}}`;
        const {{ left, width }} = view.frame.bbox;
        const every = axis.ticker.get_ticks(start, end, view.model.x_range, NaN).major;
        const ticks = every.filter((t) => t >= start && t <= end);
        return axis.formatter.doFormat(ticks, {{ loc: 0 }}).map((text, i) => {{
          const middle = left + (width * (ticks[i] - start)) / (end - start);
          const half = context.measureText(text).width / 2;
          return [middle - half, middle + half];
        }}); }}""",
        key,
    )
    return found


def colours_above_words(page: Page, key: str) -> dict[str, list[int]]:
    """By word of a strip, how many colours each of the lines of pixels just above its letters has."""
    found: dict[str, list[int]] = page.evaluate(
        f"""(key) => {{ {VIEW} const words = view.model.renderers.find((r) => r.name === "words").data_source.data;
        const {{ bbox }} = view.frame, {{ start, end }} = view.model.x_range, rows = view.model.y_range.start;
        const context = view.export("png").canvas.getContext("2d"), out = {{}};
        words.text.forEach((text, i) => {{
          const x = Math.round(bbox.left + (bbox.width * (words.x[i] - start)) / (end - start));
          const y = Math.round(bbox.top + (bbox.height * words.y[i]) / rows);
          if (x < bbox.left || x + 6 * text.length > bbox.right) return;
          out[text] = [-8, -7, -6, -5].map((dy) => {{
            const line = context.getImageData(x, y + dy, 5 * text.length, 1).data;
            const pixels = Array.from({{ length: line.length / 4 }}, (_, k) => line.slice(4 * k, 4 * k + 3).join());
            return new Set(pixels).size;
          }});
        }});
        return out; }}""",
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
