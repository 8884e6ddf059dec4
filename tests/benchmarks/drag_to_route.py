"""Time from a drag of the user in the planner page to the redrawn route, in Chromium.

    python tests/benchmarks/drag_to_route.py [PLAN.yaml] [--drags 50]

Each drag moves the user by some metres. What is timed, by the browser's clock, is from the mouse
move to the next route that is drawn, and to the finished answer; the pause `planner._REST` before
the finished answer is asked for is in the latter.
"""

import argparse
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

PLAN = Path(__file__).parents[2] / "missions" / "copter_relay.yaml"
RUN = "from faao_mav.cli.main import run\nif __name__ == '__main__':\n    run()\n"

WATCH = """() => {
  const map = document.querySelector('.planner-map'), state = document.querySelector('.state');
  window.moved = window.drawn = window.ended = null;
  map.addEventListener('mousemove', () => { window.moved ??= performance.now() }, true);
  new MutationObserver(() => { if (window.moved) window.drawn ??= performance.now() })
    .observe(map, {attributes: true, attributeFilter: ['data-drawn']});
  new MutationObserver(() => {
    if (window.drawn && state.dataset.state === 'finished') window.ended ??= performance.now() })
    .observe(state, {attributes: true});
}"""


def measure(page: Page, drags: int) -> list[tuple[float, float]]:
    """Return for each drag the milliseconds to the redrawn route and to the finished one."""
    page.wait_for_selector(".state[data-state=finished]", timeout=120_000)
    page.evaluate(WATCH)
    times = []
    for k in range(drags):
        box = page.locator('.mark[title="User"]').bounding_box()
        assert box is not None
        x, y = box["x"] + 9, box["y"] + 9
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 4, y)  # a marker moves from 3 pixels on
        page.wait_for_selector(".state[data-state=rough]", timeout=120_000)
        page.evaluate("window.moved = window.drawn = window.ended = null")
        way = 12 if k % 10 < 5 else -12
        page.mouse.move(x + way, y + way / 2)
        page.wait_for_function("window.drawn", timeout=120_000)
        page.mouse.up()
        page.wait_for_function("window.ended", timeout=120_000)
        times.append(page.evaluate("[window.drawn - window.moved, window.ended - window.moved]"))
    return [(first, last) for first, last in times]


def main() -> None:
    """Print median and worst of the drags."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plan", nargs="?", type=Path, default=PLAN)
    parser.add_argument("--drags", type=int, default=50)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "run.py"
        script.write_text(RUN)
        server = subprocess.Popen(
            [sys.executable, script, "app", asked.plan, "--no-browser"],
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            assert server.stderr is not None
            found = re.search(r"http://\S+", server.stderr.readline())
            assert found is not None
            with sync_playwright() as driver:
                browser = driver.chromium.launch(
                    executable_path=shutil.which("chromium"), args=["--no-sandbox"]
                )
                page = browser.new_page(viewport={"width": 1280, "height": 900})
                page.goto(found[0])
                times = measure(page, asked.drags)
                browser.close()
        finally:
            server.terminate()
            server.wait()
    for name, values in zip(("rough route", "finished"), zip(*times, strict=True), strict=True):
        print(f"{name:<12} median {statistics.median(values):6.0f} ms, worst {max(values):6.0f} ms")


if __name__ == "__main__":
    main()
