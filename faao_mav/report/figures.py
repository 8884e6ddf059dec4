"""The figures of one flight, as matplotlib figures: metres, seconds, m/s, bit/s/Hz, watts."""

from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.solution import Solution
from faao_mav.report.route_map import route_map
from faao_mav.report.style import MUTED, SERIES, label, legend_above, new_figure, styled
from faao_mav.report.waypoint_numbers import number_waypoints
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.prediction import Prediction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["convergence", "flight_figure", "motion", "precoder_power", "rates", "route"]

_PLAN, _PREDICTED = SERIES[0], SERIES[1]
_WIDTH = 4.2
"""Inches: a page makes it as wide as a phone, where 9 points must still be read."""
_BENEATH: dict[str, Any] = {"color": _PLAN, "linewidth": 3.6, "alpha": 0.45}
"""How a curve looks that another one may cover."""


def flight_figure(
    solution: Solution,
    conversion: Conversion | None = None,
    prediction: Prediction | None = None,
) -> "Figure":
    """Return the flight in one figure, as `--figure` saves it: map, speed, and both rates."""
    with styled():
        figure = new_figure(9.6, 5.6)
        grid = figure.add_gridspec(3, 2, width_ratios=[1.15, 1.0])
        plot = figure.add_subplot(grid[:, 0])
        route_map(solution, conversion, plot)
        plot.set_title("Route")
        speed = figure.add_subplot(grid[0, 1])
        to_uav = figure.add_subplot(grid[1, 1], sharex=speed)
        to_user = figure.add_subplot(grid[2, 1], sharex=speed, sharey=to_uav)
        _speed(speed, solution, conversion)
        _rates((to_uav, to_user), solution, prediction)
        _share_time(speed, to_uav)
        number_waypoints(solution, conversion, plot)
        return figure


def route(solution: Solution, conversion: Conversion | None = None) -> "Figure":
    """Return the map of the route: see `route_map`."""
    with styled():
        figure = new_figure(_WIDTH, 4.2)
        plot = figure.subplots()
        route_map(solution, conversion, plot)
        number_waypoints(solution, conversion, plot)
        return figure


def motion(solution: Solution, conversion: Conversion | None = None) -> "Figure":
    """Return speed and acceleration over time with v_max, v_min and a_max."""
    with styled():
        figure = new_figure(_WIDTH, 4.4)
        upper, lower = figure.subplots(2, 1, sharex=True)
        _speed(upper, solution, conversion)
        _acceleration(lower, solution)
        _share_time(upper)
        return figure


def rates(solution: Solution, prediction: Prediction | None = None) -> "Figure":
    """Return I_U and I_G of (7), (8) in every slot: planned, and where the flight is predicted."""
    with styled():
        figure = new_figure(_WIDTH, 4.4)
        upper, lower = figure.subplots(2, 1, sharex=True, sharey=True)
        _rates((upper, lower), solution, prediction)
        _share_time(upper)
        return figure


def precoder_power(solution: Solution) -> "Figure":
    """Return the power on each stream, the squared norm of each column of P_B and P_U, over time.

    Streams are numbered by their power in each slot: the rate does not depend on their order.
    Precoders that know the draw are averaged over the draws.
    """
    with styled():
        figure = new_figure(_WIDTH, 4.4)
        radio = solution.plan.radio
        stations = (
            ("Base station", solution.P_B, radio.base_station.power, "W_B"),
            ("UAV", solution.P_U, radio.relay.power, "W_U"),
        )
        plots = figure.subplots(2, 1, sharex=True)
        for plot, (name, P, power, limit) in zip(plots, stations, strict=True):
            shares = _stream_powers(P)
            unit, scale = _watts(power)
            _limit(plot, power * scale, limit)
            for k, share in enumerate(shares.T):
                plot.plot(
                    solution.t,
                    share * scale,
                    color=SERIES[k % len(SERIES)],
                    linewidth=2.4 if k == 0 else 1.2,
                    label=f"stream {k + 1}",
                )
            plot.set_ylim(bottom=0)
            label(plot, name, "time, s", f"power, {unit}")
            if len(shares.T) <= len(SERIES):
                legend_above(plot)
        _share_time(plots[0])
        return figure


def convergence(solution: Solution) -> "Figure":
    """Return R_avg after each iteration of the method."""
    from matplotlib.ticker import MaxNLocator

    with styled():
        figure = new_figure(_WIDTH, 2.6)
        plot = figure.subplots()
        steps = np.arange(len(solution.history))
        plot.plot(steps, solution.history, color=_PLAN, marker="o", markersize=3.5)
        plot.xaxis.set_major_locator(MaxNLocator(integer=True))
        plot.ticklabel_format(axis="y", useOffset=False)
        label(plot, "", "iteration", "rate R_avg, bit/s/Hz")
        return figure


def _speed(plot: "Axes", solution: Solution, conversion: Conversion | None) -> None:
    vehicle = solution.plan.vehicle
    _limit(plot, vehicle.max_speed, "v_max")
    if vehicle.min_speed > 0:
        _limit(plot, vehicle.min_speed, "v_min")
    plot.plot(solution.t, _lengths(solution.v), **_planned(conversion))
    if conversion is not None:
        schedule = conversion.schedule
        track = schedule.track()
        t = track["predicted_t"]
        over = solution.t[-1] + max(0.0, schedule.clock.late(schedule.flown))
        inside = (t >= solution.t[0]) & (t <= over)
        speed = _lengths(track["predicted_v"])[inside]
        plot.plot(t[inside], speed, color=_PREDICTED, linewidth=1.1, label="predicted")
    plot.set_ylim(bottom=0)
    label(plot, "Speed", "time, s", "speed, m/s")
    legend_above(plot)


def _acceleration(plot: "Axes", solution: Solution) -> None:
    limit, lengths = solution.plan.vehicle.max_acceleration, _lengths(solution.a)
    _limit(plot, limit, "a_max")
    plot.plot(solution.t, lengths, color=_PLAN, label="planned")
    plot.set_ylim(bottom=0)
    top = 1.2 * max(limit, float(lengths[1:].max()))
    if lengths[0] > top:  # a(0) has no bound in the paper: it would flatten all the rest
        plot.set_ylim(top=top)
        plot.annotate(
            f"a(0): {lengths[0]:.3g} m/s²",
            (0.0, 1.0),
            xytext=(12, -4),
            xycoords=plot.get_xaxis_transform(),
            textcoords="offset points",
            va="top",
        )
    label(plot, "Acceleration", "time, s", "acceleration, m/s²")
    legend_above(plot)


def _rates(plots: "tuple[Axes, Axes]", solution: Solution, prediction: Prediction | None) -> None:
    """Draw each link on its own plot: over known fading, one would hide the other."""
    planned = (("Base station to UAV", solution.I_U), ("UAV to user", solution.I_G))
    flown = (prediction.I_U, prediction.I_G) if prediction is not None else (None, None)
    curves = [values for _, values in planned] + [values for values in flown if values is not None]
    top = max(float(values.max()) for values in curves) or 1.0
    for plot, (name, values), predicted in zip(plots, planned, flown, strict=True):
        plot.plot(solution.t, values, **_planned(predicted))
        if predicted is not None:
            plot.plot(solution.t, predicted, color=_PREDICTED, linewidth=1.1, label="predicted")
        plot.set_ylim(0, 1.08 * top)
        label(plot, name, "time, s", "rate, bit/s/Hz")
        legend_above(plot)


def _planned(flown: object) -> dict[str, Any]:
    """Return how a curve of the plan looks: as a band where there is one of the flight on it."""
    return {"label": "planned"} | ({"color": _PLAN} if flown is None else _BENEATH)


def _share_time(*upper: "Axes") -> None:
    """Leave the time axis of `upper` to the plot beneath them."""
    for plot in upper:
        plot.set_xlabel("")
        plot.tick_params(labelbottom=False)


def _limit(plot: "Axes", value: float, name: str) -> None:
    plot.axhline(value, color=MUTED, linestyle=":", linewidth=1.2, label=name)


def _lengths(vectors: Real) -> Real:
    return np.asarray(np.hypot(vectors[..., 0], vectors[..., 1]))


def _stream_powers(P: Complex) -> Real:
    """Return (n, streams), W, the strongest first."""
    power = np.sort(np.sum(np.abs(P) ** 2, axis=-2), axis=-1)[..., ::-1]
    return np.asarray(power.mean(axis=0) if power.ndim == 3 else power)


def _watts(power: float) -> tuple[str, float]:
    """Return a unit in which `power` is easily read, and what a watt is in it."""
    for unit, scale in (("W", 1.0), ("mW", 1e3), ("µW", 1e6)):
        if power * scale >= 1:
            return unit, scale
    return "nW", 1e9
