"""Time from a drag of the user in the planner page to the redrawn route, in Chromium.

    python benchmarks/drag_to_route.py [PLAN.yaml] [--drags 50]

Each drag moves the user by some metres. What is timed, by the browser's clock, is from the mouse
move to the next route that is drawn.
"""

import argparse
import re
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

PLAN = Path(__file__).parents[1] / "missions" / "copter_relay.yaml"
COMMAND = Path(sys.executable).with_name("faao-mission")

WATCH = """() => {
  const map = document.querySelector('.planner-map');
  window.moved = window.drawn = null;
  map.addEventListener('mousemove', () => { window.moved = performance.now() }, true);
  new MutationObserver(() => { window.drawn ??= performance.now() })
    .observe(map, {attributes: true, attributeFilter: ['data-drawn']});
}"""


def measure(page: Page, drags: int) -> list[float]:
    """Return for each drag the milliseconds from the mouse move to the redrawn route."""
    page.wait_for_selector(".state[data-state=finished]", timeout=120_000)
    page.evaluate(WATCH)
    times = []
    for k in range(drags):
        box = page.locator('.mark[title="User"]').bounding_box()
        assert box is not None
        x, y = box["x"] + 9, box["y"] + 9
        way = 12 if k % 10 < 5 else -12
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 4, y)  # a marker moves from 3 pixels on
        redrawn(page)
        page.mouse.move(x + way, y + way / 2)
        times.append(redrawn(page))
        page.mouse.up()
        redrawn(page)
    return times


def redrawn(page: Page) -> float:
    """Wait for the next route; return the milliseconds from the last mouse move to it."""
    page.wait_for_function("window.drawn", timeout=120_000)
    taken = page.evaluate("window.drawn - window.moved")
    page.evaluate("window.drawn = null")
    return float(taken)


def main() -> None:
    """Print median and worst of the drags."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plan", nargs="?", type=Path, default=PLAN)
    parser.add_argument("--drags", type=int, default=50)
    asked = parser.parse_args()
    command = [COMMAND, "app", asked.plan, "--no-browser"]
    server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert server.stderr is not None
        found = re.search(r"http://\S+", server.stderr.readline())
        assert found is not None
        with sync_playwright() as driver:
            chromium = shutil.which("chromium")
            browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.goto(found[0])
            times = measure(page, asked.drags)
            browser.close()
    finally:
        server.terminate()
        server.wait()
    print(f"median {statistics.median(times):.0f} ms, worst {max(times):.0f} ms")


if __name__ == "__main__":
    main()
