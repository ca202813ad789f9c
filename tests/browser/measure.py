"""How fast the report of an hour of four axles is: python -m tests.browser.measure. Prints, asserts nothing.

A frame's time is the distance of two requestAnimationFrame callbacks while the wheel turns. The processor time of the
page's main thread says how much of it was work, whatever else the computer did.
"""

import resource
import tempfile
import time
from pathlib import Path

from playwright.sync_api import CDPSession, Page

from tests.browser.chromium import chromium, opened
from tests.browser.reading import plot
from tests.support.story_columns import synthetic
from wrcd.report import report_page as report

RECORD = """() => { window.frames_ms = []; let before = 0;
  const next = (now) => { if (before) window.frames_ms.push(now - before); before = now;
    window.recording = requestAnimationFrame(next); };
  window.recording = requestAnimationFrame(next); }"""
STOP = "() => { cancelAnimationFrame(window.recording); return window.frames_ms; }"
TURNS = 40


def main() -> None:
    """Write, open, zoom and move."""
    story = synthetic(3600.0, 4)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "hour.html"
        begin = time.perf_counter()
        report.write(story, None, file)
        taken, memory = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"written in {taken:.1f} s, {file.stat().st_size / 1e6:.1f} MB; the process has {memory:.0f} MB")
        with chromium() as browser, opened(browser, file) as found:
            page = found.page
            first = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
            plots = page.evaluate("performance.getEntriesByName('plots in view')[0].startTime")
            print(f"first paint {first:.0f} ms, plots in view drawn {plots:.0f} ms after the start")
            session = page.context.new_cdp_session(page)
            session.send("Performance.enable", {"timeDomain": "threadTicks"})
            box = plot(page, "axle1.time")
            page.evaluate("document.querySelector('#axle1').scrollIntoView()")
            page.mouse.move(box["x"] + 500, box["y"] + 100)
            for name, key, turn in (("zoom in", "Control", -60), ("zoom out", "Control", 60), ("move", "Shift", 60)):
                page.keyboard.down(key)
                print(f"{name}: {_frames(page, session, turn)}")
                page.keyboard.up(key)
            print("\n".join(found.complaints) or "no complaint of the console")


def _frames(page: Page, session: CDPSession, turn: int) -> str:
    busy = _busy_s(session)
    page.evaluate(RECORD)
    for _ in range(TURNS):
        page.mouse.wheel(0, turn)
    frames = sorted(page.evaluate(STOP))
    middle, late = frames[len(frames) // 2], frames[int(0.95 * len(frames))]
    work = 1000.0 * (_busy_s(session) - busy) / max(len(frames), 1)
    return f"{len(frames)} frames, median {middle:.0f} ms, 95 % {late:.0f} ms; {work:.0f} ms of processor time each"


def _busy_s(session: CDPSession) -> float:
    metrics = session.send("Performance.getMetrics")["metrics"]
    return float(next(m["value"] for m in metrics if m["name"] == "TaskDuration"))


if __name__ == "__main__":
    main()
