"""The figures say what they show, and show what the flight is."""

from dataclasses import replace
from functools import cache
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from conftest import MakePlan
from reported import conversion, flown, prediction

from faao_mav import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.shadowing import shadowed
from faao_mav.report import figures
from faao_mav.report.maps import mission_map
from faao_mav.workflow import Result


@cache
def whole() -> Any:
    """The flight in one figure."""
    return figures.flight_figure(flown().solution, conversion(), prediction())


def of_page(heading: str, result: Result) -> Any:
    """The axes of the figure under a heading of the page of `result`, but of the map."""
    with patch("faao_mav.report.figures.route_map"):
        shown = figures.plan_figures(result)
        return next(each.figure.axes for each in shown if each.heading == heading)


def lines(axes: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in axes.lines}


def test_axes_are_named_with_units_and_legends_hide_no_curve() -> None:
    with patch("faao_mav.report.figures.route_map"):
        shown = [each.figure for each in figures.plan_figures(flown()) if each.heading != "Route"]
    for figure in (whole(), *shown):
        figure.draw_without_rendering()
        plots = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
        for axes in set(figure.axes) - set(plots):
            assert axes.get_ylabel() == "planned speed, m/s"
        for axes in plots:
            assert ", " in axes.get_ylabel()
            lowest = not any(
                axes is not other and axes.get_shared_x_axes().joined(axes, other)
                and other.get_position().y0 < axes.get_position().y0
                for other in plots
            )  # fmt: skip
            assert bool(axes.get_xlabel()) == lowest
            if (legend := axes.get_legend()) is not None:
                assert legend.get_window_extent().y0 >= axes.get_window_extent().y1 - 0.5


def test_the_curves_are_the_flight() -> None:
    solution = flown().solution
    speed, acceleration = of_page("Motion", flown())
    planned = lines(speed)["planned"]
    np.testing.assert_array_equal(planned.get_xdata(), solution.t)
    np.testing.assert_array_equal(planned.get_ydata(), np.hypot(*solution.v.T))
    assert set(lines(speed)["v_max"].get_ydata()) == {solution.plan.vehicle.max_speed}
    assert set(lines(acceleration)["a_max"].get_ydata()) == {5.0}
    late = prediction().duration - solution.plan.flight.duration
    assert late > 1
    over = lines(speed)["predicted"].get_xdata()[-1]
    assert over == pytest.approx(solution.t[-1] + late, abs=0.5)  # to its end
    to_uav, to_user = of_page("Link", flown())
    np.testing.assert_array_equal(lines(to_uav)["planned"].get_ydata(), solution.I_U)
    np.testing.assert_array_equal(lines(to_user)["predicted"].get_ydata(), prediction().I_G)


@pytest.mark.parametrize(("causal", "bandwidth"), [(False, None), (True, 20.0)])
def test_what_arrives_ends_at_what_the_summary_tells(causal: bool, bandwidth: float | None) -> None:
    changes = {"causal": causal, "bandwidth_mhz": bandwidth, "gain.spread_db": 6.0}
    plan = flown().solution.plan.changed({f"radio.{key}": each for key, each in changes.items()})
    solution = replace(flown().solution, problem=build_problem(plan))
    under = shadowed(solution)
    assert under is not None
    (axes,) = of_page("What arrives", Result(solution, shadowed=under))
    whole = plan.flight.slots * plan.flight.time_step * (bandwidth / 8 if bandwidth else 1)
    reached = solution.delivered_rate if causal else solution.rates.R_avg
    ends = {name: line.get_ydata()[-1] / whole for name, line in lines(axes).items()}
    assert ends == pytest.approx({"planned": reached, "median": under.quantiles[0.5]})
    assert axes.get_ylabel() == ("arrived, megabytes" if bandwidth else "arrived, bit/Hz")
    (band,) = axes.collections
    last = np.asarray(band.get_paths()[0].vertices)
    last = last[last[:, 0] == last[:, 0].max(), 1] / whole
    assert (last.min(), last.max()) == pytest.approx((under.quantiles[0.1], under.quantiles[0.9]))


def test_an_unbounded_first_acceleration_leaves_the_rest_to_be_seen(small_plan: MakePlan) -> None:
    plan = small_plan({"flight.bound_first_acceleration": False, "radio.fading": "none"})
    solution = optimize(plan)
    a = solution.a.copy()
    a[0] = (240.0, 0.0)
    _, acceleration = of_page("Motion", Result(replace(solution, a=a)))
    assert acceleration.get_ylim()[1] < 10


def test_streams_add_up_to_the_power_and_the_strongest_is_first(small_plan: MakePlan) -> None:
    changes = {"radio.csi": "instantaneous", "radio.fading_samples": 2,
               "optimizer.max_iterations": 2}  # fmt: skip
    for solution in (flown().solution, optimize(small_plan(changes))):
        station, _ = of_page("Precoders", Result(solution))
        first, second = (lines(station)[f"stream {k}"].get_ydata() for k in (1, 2))
        used = np.sum(np.abs(solution.P_B) ** 2, axis=(-2, -1))
        each_slot = used.mean(axis=0) if used.ndim == 2 else used  # averaged over the draws
        np.testing.assert_allclose(first + second, each_slot)
        assert np.all(first >= second)


def test_the_map_has_stations_waypoints_and_fence() -> None:
    found = flown()
    figure = whole()
    axes = figure.axes[0]
    names = {text.get_text() for text in axes.texts}
    items = enumerate(conversion().mission.items, 1)
    numbers = {str(number) for number, item in items if item.command == 16}
    assert len(numbers) > 1
    assert {"base station", "user"} < names <= {"base station", "user"} | numbers
    outlines = [line.get_xydata() for line in axes.lines if line.get_linestyle() == "-"]
    (east, north), *_ = [np.asarray(line).T for line in outlines if np.size(line) > 40]
    np.testing.assert_allclose(np.ptp(east), 10.0, rtol=1e-3)
    np.testing.assert_allclose(north.mean(), 0.0002 * 110_950, rtol=0.05)  # m per degree
    # a fence of kilometres leaves the route to be seen
    figure.draw_without_rendering()
    assert np.ptp(axes.get_xlim()) < 5 * np.ptp(found.solution.w[:, 0])


def test_what_is_written_on_a_map_covers_nothing() -> None:
    found = flown()
    assert found.check is not None
    assert found.check.track is not None
    for figure in (whole(), mission_map(conversion().mission, found.check.track)):
        figure.draw_without_rendering()
        plot = figure.axes[0]
        edge, boxes = plot.get_window_extent(), [text.get_window_extent() for text in plot.texts]
        assert len(boxes) > 4
        lines = [plot.transData.transform(line.get_xydata()) for line in plot.lines]
        route = plot.transData.transform(found.solution.w)
        for box in boxes:
            assert box.count_overlaps(boxes) == 1  # itself
            assert not any(box.count_contains(places) for places in (route, *lines))
            assert edge.contains(*box.min)
            assert edge.contains(*box.max)
