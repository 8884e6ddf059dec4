"""Figures show what the flight is; the page is complete, safe, and without a network."""

import re
import shutil
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from conftest import SMALL, MakePlan, edited

from faao_mav import optimize, plan_mission
from faao_mav.errors import InfeasibleError
from faao_mav.mission.fence import Circle, Fence, Polygon
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.shadowing import shadowed
from faao_mav.plan import parse_plan
from faao_mav.report import figures, summary
from faao_mav.report.maps import mission_map
from faao_mav.report.page import render_report
from faao_mav.validate import Check, Finding, Level
from faao_mav.workflow import Result

CHROMIUM = shutil.which("chromium")
HOSTILE = "</title><script>alert('x')</script> $\\frac & \" 'π' 中"
FINDINGS = (
    Finding(Level.ERROR, "fence-leg", 4, "the leg is <b>outside</b>", "go around & back"),
    Finding(Level.NOTE, "far", None, "it is far", ""),
)


@cache
def flown() -> Any:
    """One flight, with a fence and a hostile name."""
    text = edited(SMALL, {"name": HOSTILE, "radio.fading": "none"})
    result: Any = plan_mission(parse_plan(text))
    lat, lon = -35.363262, 149.165237
    corners = ((lat - 0.01, lon - 0.01), (lat + 0.01, lon - 0.01), (lat, lon + 0.01))
    zone = Circle((lat + 0.0002, lon + 0.0006), 5.0, inclusion=False)
    fence = Fence((Polygon(corners, inclusion=True),), (zone,))
    mission = replace(result.conversion.mission, fence=fence)
    return replace(
        result,
        solution=replace(result.solution, starts={"straight": 1.0, "bs": 1.1}),
        conversion=replace(result.conversion, mission=mission),
        check=replace(result.check, mission=mission, findings=FINDINGS),
    )


@cache
def whole() -> Any:
    """The flight in one figure."""
    return figures.flight_figure(flown().solution, flown().conversion, flown().prediction)


def of_page(result: Result) -> dict[str, Any]:
    """The figures of the page of `result` by their headings, without the map."""
    with patch("faao_mav.report.figures.route_map"):
        shown = figures.plan_figures(result)
        return {each.heading: each.figure for each in shown if each.heading != "Route"}


def lines(axes: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in axes.lines}


def test_axes_are_named_with_units_and_legends_hide_no_curve() -> None:
    solution = flown().solution
    weaker = Result(replace(solution, I_U=solution.I_U / 2))  # the hop that is drawn first
    for figure in (whole(), *of_page(flown()).values(), *of_page(weaker).values()):
        figure.draw_without_rendering()
        plots = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
        for axes in set(figure.axes) - set(plots):
            assert axes.get_ylabel() == "planned speed, m/s"
        for axes in plots:
            assert ", " in axes.get_ylabel()
            assert axes.get_ylim()[1] >= axes.dataLim.y1
            lowest = not any(
                axes is not other and axes.get_shared_x_axes().joined(axes, other)
                and other.get_position().y0 < axes.get_position().y0
                for other in plots
            )  # fmt: skip
            assert bool(axes.get_xlabel()) == lowest
            if (legend := axes.get_legend()) is not None:
                assert legend.get_window_extent().y0 >= axes.get_window_extent().y1 - 0.5


def test_the_curves_are_the_flight() -> None:
    solution, prediction, page = flown().solution, flown().prediction, of_page(flown())
    speed, acceleration = page["Motion"].axes
    planned = lines(speed)["planned"]
    np.testing.assert_array_equal(planned.get_xdata(), solution.t)
    np.testing.assert_array_equal(planned.get_ydata(), np.hypot(*solution.v.T))
    assert set(lines(speed)["v_max"].get_ydata()) == {solution.plan.vehicle.max_speed}
    assert set(lines(acceleration)["a_max"].get_ydata()) == {5.0}
    late = prediction.duration - solution.plan.flight.duration
    assert late > 1
    over = lines(speed)["predicted"].get_xdata()[-1]
    assert over == pytest.approx(solution.t[-1] + late, abs=0.5)  # to its end
    to_uav, to_user = page["Link"].axes
    np.testing.assert_array_equal(lines(to_uav)["planned"].get_ydata(), solution.I_U)
    np.testing.assert_array_equal(lines(to_user)["predicted"].get_ydata(), prediction.I_G)
    a, free = solution.a.copy(), solution.plan.changed({"flight.bound_first_acceleration": False})
    a[0] = (240.0, 0.0)  # the rest is to be seen
    unbounded = Result(replace(solution, a=a, problem=build_problem(free)))
    _, acceleration = of_page(unbounded)["Motion"].axes
    assert acceleration.get_ylim()[1] < 10


@pytest.mark.parametrize(("causal", "bandwidth"), [(False, None), (True, 20.0)])
def test_what_arrives_ends_at_what_the_summary_tells(causal: bool, bandwidth: float | None) -> None:
    changes = {"causal": causal, "bandwidth_mhz": bandwidth, "gain.spread_db": 6.0}
    plan = flown().solution.plan.changed({f"radio.{key}": each for key, each in changes.items()})
    solution = replace(flown().solution, problem=build_problem(plan))
    under = shadowed(solution)
    assert under is not None
    (axes,) = of_page(Result(solution, shadowed=under))["What arrives"].axes
    whole = plan.flight.slots * plan.flight.time_step * (bandwidth / 8 if bandwidth else 1)
    reached = solution.delivered_rate if causal else solution.rates.R_avg
    ends = {name: line.get_ydata()[-1] / whole for name, line in lines(axes).items()}
    assert ends == pytest.approx({"planned": reached, "median": under.quantiles[0.5]})
    assert axes.get_ylabel() == ("arrived, megabytes" if bandwidth else "arrived, bit/Hz")
    (band,) = axes.collections
    last = np.asarray(band.get_paths()[0].vertices)
    last = last[last[:, 0] == last[:, 0].max(), 1] / whole
    assert (last.min(), last.max()) == pytest.approx((under.quantiles[0.1], under.quantiles[0.9]))


def test_streams_add_up_to_the_power_and_the_strongest_is_first(small_plan: MakePlan) -> None:
    changes = {"radio.csi": "instantaneous", "radio.fading_samples": 2,
               "optimizer.max_iterations": 2}  # fmt: skip
    for solution in (flown().solution, optimize(small_plan(changes))):
        station, _ = of_page(Result(solution))["Precoders"].axes
        first, second = (lines(station)[f"stream {k}"].get_ydata() for k in (1, 2))
        used = np.sum(np.abs(solution.P_B) ** 2, axis=(-2, -1))
        each_slot = used.mean(axis=0) if used.ndim == 2 else used  # averaged over the draws
        np.testing.assert_allclose(first + second, each_slot)
        assert np.all(first >= second)


def test_the_map_has_stations_waypoints_and_fence_and_covers_nothing() -> None:
    mission, w = flown().conversion.mission, flown().solution.w
    whole().draw_without_rendering()
    axes = whole().axes[0]
    names = {text.get_text() for text in axes.texts}
    numbers = {str(number) for number, item in enumerate(mission.items, 1) if item.command == 16}
    assert len(numbers) > 1
    assert {"base station", "user"} < names <= {"base station", "user"} | numbers
    outlines = [line.get_xydata() for line in axes.lines if line.get_linestyle() == "-"]
    (east, north), *_ = [np.asarray(line).T for line in outlines if np.size(line) > 40]
    np.testing.assert_allclose(np.ptp(east), 10.0, rtol=1e-3)
    np.testing.assert_allclose(north.mean(), 0.0002 * 110_950, rtol=0.05)  # m per degree
    # a fence of kilometres leaves the route to be seen
    assert np.ptp(axes.get_xlim()) < 5 * np.ptp(w[:, 0])
    for figure in (whole(), mission_map(mission, flown().check.track)):
        figure.draw_without_rendering()
        plot: Any = figure.axes[0]
        edge, boxes = plot.get_window_extent(), [text.get_window_extent() for text in plot.texts]
        assert len(boxes) > 4
        drawn = [plot.transData.transform(line.get_xydata()) for line in plot.lines]
        for box in boxes:
            assert box.count_overlaps(boxes) == 1  # itself
            assert not any(box.count_contains(p) for p in (plot.transData.transform(w), *drawn))
            assert edge.contains(*box.min)
            assert edge.contains(*box.max)


class Page(HTMLParser):
    """The elements of a page: their attributes, their texts; every one is closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in ("meta", "br", "link", "img", "input", "hr"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            self.texts.append((self.open[-1], data))

    def of(self, tag: str) -> list[str]:
        return [text for element, text in self.texts if element == tag]


@pytest.fixture(scope="module")
def full() -> str:
    return render_report(flown())


def test_every_section_is_there_and_says_what_the_summary_says(full: str) -> None:
    page, parameters = Page(full), flown().conversion.parameters
    sections = "Result Findings Parameters Route Motion Link Queue Convergence Precoders Plan"
    assert page.of("h2") == sections.split()
    pictures = [attributes for tag, attributes in page.elements if tag == "svg"]
    assert len(pictures) == 6
    titles = {a["id"] for tag, a in page.elements if tag == "title" and "id" in a}
    assert titles == {picture["aria-labelledby"] for picture in pictures}
    assert page.of("text").count("predicted") == 5  # map, speed, both rates and the queue
    values = {f"{value:g}" for value in parameters.values()}
    assert {*parameters} < {*page.of("dt")}
    assert values < {*page.of("dd")}
    shown = " ".join(text for _, text in page.texts)
    assert re.search(r"faao-mav \d.*numpy \d.*Python \d", shown)
    said = summary(flown(), verbose=True).replace(" +- ", " ± ")
    (more,) = (text for text in page.of("dd") if text not in said and text not in values)
    assert more.startswith("converged after")
    # the same flight has the same page, however long it took
    assert render_report(replace(flown(), seconds_optimize=99.0, seconds_total=100.0)) == full


@pytest.mark.usefixtures("unpainted")
def test_a_part_that_is_not_there_leaves_its_sections_out() -> None:
    none = Result(flown().solution, no_mission=InfeasibleError("too many items"))
    page = Page(render_report(none))
    assert "none: too many items" in page.of("dd")
    assert "Findings" not in page.of("h2")
    made = flown().conversion
    sound = Check(made.mission, made.vehicle, unpredicted="no model")
    page = Page(render_report(sound))
    assert (page.of("h1"), page.of("h2")) == (["Relay flight"], ["Result", "Findings"])
    assert "no model" in page.of("dd")
    assert Page(render_report(sound, title="Checked")).of("h1") == ["Checked"]


def test_nothing_comes_from_elsewhere_and_names_are_text(full: str) -> None:
    page = Page(full)
    loading = {"script", "link", "img", "iframe", "object"}
    assert not loading & {tag for tag, _ in page.elements}
    for tag, attributes in page.elements:
        for name, value in attributes.items():
            assert not name.startswith("on"), (tag, name)
            if name in ("href", "src", "xlink:href"):
                assert (value or "").startswith("#"), (tag, value)
    assert not any(word in full for word in ("http:", "https:", "@import", "<script"))
    ids = [a["id"] for _, a in page.elements if a.get("id")]
    assert len(ids) == len(set(ids))
    targets = re.findall(r"url\(([^)]*)\)", full) + re.findall(r'href="([^"]*)"', full)
    assert {target[0] for target in targets} == {"#"}
    assert {target[1:] for target in targets} <= set(ids)
    assert page.of("h1") == [HOSTILE] == page.of("title")[:1]
    assert "item 4: the leg is <b>outside</b> [fence-leg]" in "".join(page.of("li"))
    assert page.of("b") == ["error", "note"]
    assert "".join(page.of("pre")) == flown().solution.plan.text
    blocks = re.findall(r":root \{(.*?)\}", full, re.DOTALL)
    light, dark = (set(re.findall(r"(--\w+):", block)) for block in blocks)
    assert light == dark
    assert set(re.findall(r"var\((--\w+)\)", full)) <= light


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium to show the page with")
def test_a_phone_shows_it_without_scrolling_sideways(tmp_path: Path, full: str) -> None:
    playwright = pytest.importorskip("playwright.sync_api", reason="no playwright to drive it")
    (tmp_path / "page.html").write_text(full)
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 320, "height": 600})
        page.goto((tmp_path / "page.html").as_uri())
        whole = page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        heights = "[...document.querySelectorAll('svg')].map(x => x.getBoundingClientRect().height)"
        assert (whole, min(page.evaluate(heights)) > 99) == (True, True)
        browser.close()
