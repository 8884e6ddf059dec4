"""The planner page in a real Chromium: what is dragged and drawn, told, downloaded and uploaded."""

import base64
import itertools
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import FLYABLE, PATIENCE
from planted import plant
from served import HOME, vehicle
from test_serve import mbtiles
from typer.testing import CliRunner

from faao_mav import optimize
from faao_mav.arrays import Real
from faao_mav.cli.main import app
from faao_mav.errors import PlanError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence, Polygon
from faao_mav.mission.formats import write_mission
from faao_mav.mission.item import Mission
from faao_mav.plan import parse_plan, read_plan
from faao_mav.sim.faults import Faults

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Page

CHROMIUM = shutil.which("chromium")
pytest.importorskip("nicegui", reason="the extra app is not installed")
playwright = pytest.importorskip("playwright.sync_api", reason="no playwright to drive a browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium to show the page with")

PLAN = "# a comment that stays" + FLYABLE.replace("  causal: false\n", "").replace(
    "duration: 10", "duration: 14"
)
LOGS = Path(__file__).parents[1] / "data" / "logs"
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
"""A picture of one pixel."""
COMMAND = Path(sys.executable).with_name("faao-mission")
CURVES = """() => [...document.querySelectorAll('.charts > *')].flatMap(
  (each) => getElement(each).chart.getOption().series.map(({ name }) => name))"""
"""The name of each curve of the charts."""
WAIT = 1000 * PATIENCE
"""Milliseconds until something on the page has happened: the machine may be busy."""
MAP = (
    "document.querySelector('#app')._vnode.component.proxy"
    ".$refs['r' + document.querySelector('.planner-map').id.slice(1)]"
)
"""The component of the map, in JavaScript."""


@dataclass
class Served:
    """A server of the page for `plan`, at `address` with the token."""

    plan: Path
    address: str
    context: "BrowserContext"
    troubles: list[str] = field(default_factory=list)

    def window(self, width: int = 1200) -> "Page":
        """A new window that shows the finished flight; what goes wrong in it is a trouble."""
        page = self.context.new_page()
        page.set_default_timeout(WAIT)
        page.set_viewport_size({"width": width, "height": 800})
        local = (self.address.partition("?")[0], "data:", "blob:")
        trouble = self.troubles.append
        page.on("pageerror", lambda error: trouble(str(error)))
        odd = ("error", "warning")
        page.on("console", lambda said: trouble(said.text) if said.type in odd else None)
        page.on("request", lambda r: None if r.url.startswith(local) else trouble(r.url))
        page.goto(self.address)
        finished(page)
        return page


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One server and one browser for all tests; the server is run in the folder of the plan.

    Ctrl-C comes in the middle of its work: it ends in seconds, says no more than that, and has run
    nothing of the folder.
    """
    folder = tmp_path_factory.mktemp("app")
    plan, ran = folder / "a plan.yaml", plant(folder)
    plan.write_text(PLAN)
    tiles = mbtiles(folder / "field.mbtiles", ((0, 0, 0, PIXEL),))
    process = subprocess.Popen(
        [COMMAND, "app", plan, "--mbtiles", tiles, "--no-browser"],
        stderr=subprocess.PIPE, text=True, cwd=folder, env=os.environ | {"OMP_NUM_THREADS": "1"},
        start_new_session=True,
    )  # fmt: skip
    try:
        assert process.stderr is not None
        found = re.search(r"http://\S+", process.stderr.readline())
        assert found is not None
        with playwright.sync_playwright() as driver:
            plainly = ["--no-sandbox", "--disable-gpu"]
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=plainly)
            yield (here := Served(plan, found[0], browser.new_context()))
            plan.write_text(PLAN)
            with vehicle(faults=Faults(loss=0.2, rate=300)) as (connection, _):
                page = here.window()
                page.get_by_role("tab", name="Fly").click()
                page.get_by_label("Connection").fill(connection)
                page.get_by_role("button", name="Upload and verify").click()
                page.locator(".stands", has_text="mission").wait_for()
                page.get_by_role("tab", name="Plan").click()
                enter(page, "duration, s", "60")
                assert here.troubles == []
                os.killpg(process.pid, signal.SIGINT)
                _, said = process.communicate(timeout=PATIENCE)
                page.close()
            browser.close()
    finally:
        process.kill()
    assert said in ("faao-mission: ended\n", "")  # "": where Ctrl-C is ignored by the parent
    assert not ran.exists()


@pytest.fixture
def window(served: Served) -> Iterator["Page"]:
    served.plan.write_text(PLAN)
    page = served.window()
    yield page
    page.close()


def finished(page: "Page") -> float:
    """Wait until the page says that its answer is finished; return the delivered rate."""
    page.wait_for_selector(".state[data-state=finished]")
    return float(page.locator(".rate").get_attribute("data-delivered") or "nan")


def route_of(page: "Page") -> Real:
    """Return latitude and longitude (n, 2) of the route as it is drawn."""
    first, *rest = page.evaluate(
        f"{MAP}.route.getLayers().filter((line) => line.options.className === 'route')"
        ".map((line) => line.getLatLngs().map((p) => [p.lat, p.lng]))"
    )
    return np.array([*first, *(place for line in rest for place in line[1:])])


def zoom_out(page: "Page") -> None:
    """Zoom out by one step; the map has then come to rest."""
    zoom = page.evaluate(f"{MAP}.map.getZoom()")
    page.locator(".leaflet-control-zoom-out").click()
    page.wait_for_function(
        f"{MAP}.map.getZoom() < {zoom} && !document.querySelector('.leaflet-zoom-anim')"
    )


def drag(page: "Page", title: str, east: float, north: float) -> None:
    """Drag a marker by some pixels, in steps as a hand does."""
    box = page.locator(f'.mark[title="{title}"]').bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(1, 6):
        page.mouse.move(x + k * east / 5, y - k * north / 5)
    page.mouse.up()


def enter(page: "Page", label: str, value: str) -> None:
    box = page.get_by_label(label)
    box.fill(value)
    box.press("Enter")


def saved(page: "Page", served: Served) -> str:
    """Save what was changed; return the file's text. The server has then seen every change."""
    page.locator(".bar .name").click()
    save = page.locator('[aria-label="Save (Ctrl+S)"]')
    save.and_(page.locator(":enabled")).wait_for()
    page.keyboard.press("Control+s")
    save.and_(page.locator(":disabled")).wait_for()
    return served.plan.read_text()


def downloaded(page: "Page", label: str) -> bytes:
    page.locator('[aria-label="Download"]').click()
    with page.expect_download() as waiting:
        page.get_by_text(label, exact=True).click()
    path = waiting.value.path()
    return Path(path).read_bytes()


def test_a_dragged_user_changes_flight_and_rate_as_the_command_line_says(
    window: "Page", served: Served, tmp_path: Path
) -> None:
    first, route = finished(window), route_of(window)
    for _ in range(2):
        zoom_out(window)
    drag(window, "User", 150, 60)
    text = saved(window, served)
    rate = finished(window)
    assert text.startswith("# a comment that stays")
    moved = parse_plan(text)
    assert math.dist(moved.radio.ground_user.position, (60, 60)) > 100
    out, result = tmp_path / "mission.waypoints", tmp_path / "result.npz"
    table = tmp_path / "precoders.csv"
    files = ("--out", out, "--precoders", table, "--save", result)
    told = json.loads(subprocess.check_output([COMMAND, served.plan, *files, "--json"]))
    assert abs(rate - first) > 0.01
    assert rate == pytest.approx(told["delivered_rate"], abs=1e-6)
    frame = LocalFrame(moved.origin.latitude, moved.origin.longitude)
    with np.load(result) as archive:
        flown = np.stack(frame.to_geodetic(archive["w"]), axis=1)
    assert np.abs(route_of(window) - flown).max() < 1e-8
    assert np.abs(route - flown).max() > 1e-4

    # what is downloaded is what the command line writes
    assert downloaded(window, "Mission, QGC WPL 110 (.waypoints)") == out.read_bytes()
    assert downloaded(window, "Parameters") == (tmp_path / "mission.param").read_bytes()
    assert downloaded(window, "Precoders (.csv)") == table.read_bytes()
    assert downloaded(window, "Plan (.yaml)").decode() == text

    # one drag is one step back
    window.locator('[aria-label="Undo (Ctrl+Z)"]').click()
    assert saved(window, served) == PLAN
    assert finished(window) == pytest.approx(first, abs=1e-9)


def test_the_route_goes_round_a_zone_that_is_drawn(window: "Page", served: Served) -> None:
    ends = [window.locator(f'.mark[title="{name}"]').bounding_box() for name in ("Start", "End")]
    assert all(ends)
    x, y = (sum(box[axis] + 9 for box in ends if box) / 2 for axis in ("x", "y"))
    window.locator('[aria-label="Stay out of a circle"]').click()
    window.locator(".planner-map.drawing").wait_for()
    window.mouse.click(x, y)
    window.mouse.click(x + 40, y)
    text = saved(window, served)
    finished(window)
    (zone,) = parse_plan(text).zones
    assert zone.disc is not None
    away = np.hypot(*(optimize(parse_plan(text)).w - zone.disc[:2]).T)
    assert away.min() >= zone.disc[2] + 5 - 1e-6  # the margin
    assert window.locator(".leaflet-pane path.margin").count() == 1
    assert downloaded(window, "Fence")
    window.locator(".leaflet-pane path.zone-out").click(position={"x": 3, "y": 40})
    window.locator('.mark[title="Radius"]').wait_for()
    window.locator('[aria-label^="Delete the chosen zone"]').click()
    assert saved(window, served) == PLAN
    assert window.locator(".leaflet-pane path.zone-out").count() == 0


def test_a_bad_value_is_told_at_its_field_in_the_words_of_the_command_line(window: "Page") -> None:
    window.get_by_role("tab", name="Result").click()
    window.locator(".facts dt").first.wait_for()
    window.get_by_role("tab", name="Plan").click()
    window.get_by_text("vehicle", exact=True).click()
    enter(window, "max_speed, m/s", "-1")
    window.locator(".state[data-state='not a plan yet']").wait_for()
    with pytest.raises(PlanError) as error:
        parse_plan(PLAN.replace("max_speed: 10", "max_speed: -1"), "plan.yaml")
    said = str(error.value).removeprefix("plan.yaml: vehicle.max_speed: ")
    assert said in window.locator(".q-field--error").inner_text()
    assert window.locator('[data-key="vehicle.max_speed"]').count() == 1
    # what was found for the plan before is not shown as if it were of this one
    assert window.evaluate(CURVES) == []
    assert window.locator(".facts dt").count() == 0
    assert window.locator(".command").is_hidden()
    enter(window, "max_speed, m/s", "9.9")
    finished(window)
    assert window.locator(".q-field--error").count() == 0
    assert window.evaluate(CURVES)[:2] == ["base station to UAV", "UAV to user"]


def test_what_is_uploaded_and_watched_flies_by_the_command_that_is_shown(
    window: "Page", served: Served, tmp_path: Path
) -> None:
    with vehicle(speedup=8.0) as (connection, mock):  # time to hear it on a busy machine
        window.get_by_role("tab", name="Fly").click()
        window.get_by_label("Connection").fill(connection)
        window.get_by_role("button", name="Upload and verify").click()
        told = window.locator(".uploaded", has_text="verified")
        told.wait_for()
        assert "read back and compared" in told.inner_text()
        command = window.locator(".command", has_text=connection).inner_text()
        assert command.endswith(f" --plan '{served.plan}' --arm")
        with window.expect_download() as waiting:
            window.get_by_role("button", name="Download mission.plan").click()
        waiting.value.save_as(tmp_path / "mission.plan")

        window.get_by_role("button", name="Watch").click()
        window.locator(".stands", has_text="waiting").wait_for()
        assert not mock.armed
        path = f"{COMMAND.parent}{os.pathsep}{os.environ['PATH']}"
        flight = subprocess.run(
            command, shell=True, capture_output=True, text=True, cwd=tmp_path,
            env=os.environ | {"PATH": path},
        )  # fmt: skip
        assert flight.returncode == 0, flight.stderr
        told = window.locator(".uploaded", has_text="landed and disarmed")
        told.wait_for()
    for said in (told.inner_text(), flight.stdout):
        assert re.search(r"^flown +delivers .* % of the plan", said, re.MULTILINE)
    assert window.locator(".mark-vehicle").count() == 1
    window.locator("path.flown[d*=L]").wait_for()
    window.locator(".key", has_text="flown").wait_for()


def test_zones_of_a_file_and_the_ways_of_stations_are_shown_and_the_key_says_so(
    served: Served,
) -> None:
    rings = [(-300, -300), (400, -300), (400, 400), (-300, 400)], [(90, 90), (120, 90), (90, 120)]
    frame = LocalFrame(HOME.latitude, HOME.longitude)
    areas = [zip(*frame.to_geodetic(ring), strict=True) for ring in rings]
    fence = Fence(tuple(Polygon((*area,), inclusion=not k) for k, area in enumerate(areas)))
    write_mission(Mission((), HOME, fence), served.plan.with_name("site.plan"))
    served.plan.with_name("way.csv").write_text("time_s,east_m,north_m\n0,60,60\n14,95,60\n")
    text = PLAN.replace("base_station: {", "base_station: {velocity: [3, 0], ")
    text = text.replace("{position: [60, 60]", "{track: way.csv")
    text += "fence: {file: site.plan, exclusion: [{center: [-100, 80], radius: 20}]}\n"
    served.plan.write_text(text)
    page = served.window()
    colours = page.evaluate(
        """() => [...document.querySelectorAll('.leaflet-pane path')].map(
             (line) => [line.getAttribute('class').split(' ')[0], getComputedStyle(line).stroke])"""
    )
    drawn = [(name, colour) for name, colour in colours if name.startswith("zone")]
    red, green = "rgb(194, 59, 59)", "rgb(42, 138, 74)"
    assert sorted(drawn) == [("zone-in", green), ("zone-out", red), ("zone-out", red)]
    key = page.locator(".key").inner_text().split("\n")
    lines = ["stay in", "stay out", "margin of the fence", "predicted flight", "stations move"]
    assert key[1:] == lines
    # the numbers of waypoints stand apart from each other and from the marks
    boxes = page.locator(".waypoint i, .mark").evaluate_all(
        "(all) => all.map((each) => each.getBoundingClientRect().toJSON())"
    )
    assert len(boxes) > 5
    for one, other in itertools.combinations(boxes, 2):
        across = one["left"] < other["right"] and other["left"] < one["right"]
        assert not (across and one["top"] < other["bottom"] and other["top"] < one["bottom"])
    marks = page.locator(".mark span").all_inner_texts()
    assert {"Base station at the end", "User at the end"} < {*marks}
    assert "User" not in marks  # its track is a file
    # the way goes along when its station is dragged
    drag(page, "Base station", 10, 40)
    saved(page, served)
    finished(page)
    plan = read_plan(served.plan)
    base, user = plan.radio.stations
    assert base.velocity == (3, 0)
    assert base.position[1] > 5
    ends = [place for each in (base, user) for place in each.at(np.array([0.0, 13.5]))]
    ways = np.array(page.evaluate(f"{MAP}.ways"))[[0, 27, 28, -1]]
    np.testing.assert_allclose(frame.to_local(*ways.T), ends, atol=0.01)
    page.close()


def test_a_log_that_is_dropped_is_told_as_the_command_line_tells_it(window: "Page") -> None:
    log, plan = LOGS / "arducopter.tlog", LOGS / "plan.yaml"
    window.get_by_role("tab", name="Fly").click()
    told = window.locator(".debriefing")
    window.locator('[aria-label="Open a plan"]').click()
    window.locator(".q-dialog input").set_input_files(plan)
    window.locator(".state[data-state=computing]").wait_for()
    finished(window)
    window.locator(".log input").set_input_files(log)
    window.locator(".debriefing", has_text="delivers").wait_for()
    said = CliRunner().invoke(app, ["debrief", str(log), "--plan", str(plan)])
    assert told.inner_text().splitlines() == said.output.splitlines()
    window.locator("path.flown[d*=L]").wait_for()


def test_two_windows_do_not_disturb_each_other(window: "Page", served: Served) -> None:
    other = served.window(width=390)
    rate = finished(other)
    drag(window, "Start", 60, 10)
    saved(window, served)
    assert finished(window) != rate
    assert finished(other) == rate
    # light or dark is what the system prefers
    for scheme, body in (("light", "body:not(.body--dark)"), ("dark", "body.body--dark")):
        other.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        other.locator(body).wait_for()
    # a phone shows it without scrolling sideways
    assert other.evaluate("document.documentElement.scrollWidth") <= 390
    # the background map of the field
    assert window.locator("img.leaflet-tile").count() == 0
    window.get_by_role("switch", name="Background").click()
    window.locator("img.leaflet-tile-loaded").wait_for()
    # what another window has saved is not overwritten
    text = served.plan.read_text()
    other.locator(".bar .name").click()
    other.keyboard.press("Control+s")
    other.get_by_text("was changed since it was opened").wait_for()
    assert served.plan.read_text() == text
    other.close()


def test_without_the_token_there_is_nothing_and_no_other_page_gets_in(served: Served) -> None:
    here, _, query = served.address.partition("?")

    def answer(path: str, **headers: str) -> int:
        try:
            request = urllib.request.Request(here + path, headers=headers)
            with urllib.request.urlopen(request) as got:
                return int(got.status)
        except urllib.error.HTTPError as error:
            return error.code

    socket_io, picture = "_nicegui_ws/socket.io/?EIO=4&transport=polling", "tiles/0/0/0"
    for path in ("", "_nicegui/static/nicegui.js", picture, socket_io):
        assert answer(path) == 403
    port = here.rpartition(":")[2].strip("/")
    cookie = f"faao-app-{port}={query.removeprefix('token=')}"
    for path, status in ((socket_io, 200), (picture, 200), ("tiles/1/0/0", 204)):
        assert answer(path, Cookie=cookie) == status
    assert answer(socket_io, Cookie=cookie, Origin="http://evil.org") == 403
    table = Path("/proc/net/tcp")
    if table.exists():  # Linux tells that it listens on loopback alone
        sockets = [line.split() for line in table.read_text().splitlines()]
        listening = {words[1] for words in sockets if words[3] == "0A"}
        own = f"{int(port):04X}"
        assert {each for each in listening if each.endswith(own)} == {f"0100007F:{own}"}
