"""The figures of one flight, as matplotlib figures: metres, seconds, m/s, bit/s/Hz, watts."""

from typing import TYPE_CHECKING

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.faao.solution import Solution
from faao_mav.mission.convert import Conversion
from faao_mav.mission.prediction import Prediction
from faao_mav.report.route_map import route_map
from faao_mav.report.style import MUTED, SERIES, label, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["convergence", "flight_figure", "motion", "precoder_power", "rates", "route"]

_PLAN, _PREDICTED, _OTHER = SERIES[0], SERIES[1], SERIES[2]


def flight_figure(
    solution: Solution,
    conversion: Conversion | None = None,
    prediction: Prediction | None = None,
) -> "Figure":
    """Return the flight in one figure, as `--figure` saves it: map, speed, and both rates."""
    with styled():
        figure = new_figure(9.6, 5.0)
        grid = figure.add_gridspec(2, 2, width_ratios=[1.25, 1.0])
        route_map(solution, conversion, figure.add_subplot(grid[:, 0]))
        _speed(figure.add_subplot(grid[0, 1]), solution, conversion)
        _rate(figure.add_subplot(grid[1, 1]), solution, prediction)
        return figure


def route(solution: Solution, conversion: Conversion | None = None) -> "Figure":
    """Return the map of the route: see `route_map`."""
    with styled():
        figure = new_figure(5.8, 4.8)
        route_map(solution, conversion, figure.subplots())
        return figure


def motion(solution: Solution, conversion: Conversion | None = None) -> "Figure":
    """Return speed and acceleration over time with v_max, v_min and a_max."""
    with styled():
        figure = new_figure(5.4, 4.6)
        upper, lower = figure.subplots(2, 1, sharex=True)
        _speed(upper, solution, conversion)
        _limit(lower, solution.plan.vehicle.max_acceleration, "a_max")
        lower.plot(solution.t, _lengths(solution.a), color=_PLAN, label="planned")
        lower.set_ylim(bottom=0)
        label(lower, "Acceleration", "time, s", "acceleration, m/s²")
        lower.legend(loc="best")
        return figure


def rates(solution: Solution, prediction: Prediction | None = None) -> "Figure":
    """Return I_U and I_G of (7), (8) in every slot: planned, and where the flight is predicted."""
    with styled():
        figure = new_figure(5.4, 3.4)
        _rate(figure.subplots(), solution, prediction)
        return figure


def precoder_power(solution: Solution) -> "Figure":
    """Return the power on each stream, the squared norm of each column of P_B and P_U, over time.

    Streams are numbered by their power in each slot: the rate does not depend on their order.
    Precoders that know the draw are averaged over the draws.
    """
    with styled():
        figure = new_figure(5.4, 4.6)
        radio = solution.plan.radio
        stations = (
            ("Base station", solution.P_B, radio.base_station.power),
            ("UAV", solution.P_U, radio.relay.power),
        )
        plots = figure.subplots(2, 1, sharex=True)
        for plot, (name, P, power) in zip(plots, stations, strict=True):
            shares = _stream_powers(P)
            unit, scale = _watts(power)
            _limit(plot, power * scale, "limit W")
            for k, share in enumerate(shares.T):
                plot.plot(
                    solution.t,
                    share * scale,
                    color=SERIES[k % len(SERIES)],
                    label=f"stream {k + 1}",
                )
            plot.set_ylim(bottom=0)
            label(plot, name, "time, s", f"power, {unit}")
            if len(shares.T) <= len(SERIES):
                plot.legend(loc="best", ncols=3)
        return figure


def convergence(solution: Solution) -> "Figure":
    """Return R_avg after each iteration of the method."""
    from matplotlib.ticker import MaxNLocator

    with styled():
        figure = new_figure(5.4, 3.0)
        plot = figure.subplots()
        steps = np.arange(len(solution.history))
        plot.plot(steps, solution.history, color=_PLAN, marker="o", markersize=3.5)
        plot.xaxis.set_major_locator(MaxNLocator(integer=True))
        label(plot, "Convergence", "iteration", "rate R_avg, bit/s/Hz")
        return figure


def _speed(plot: "Axes", solution: Solution, conversion: Conversion | None) -> None:
    vehicle = solution.plan.vehicle
    _limit(plot, vehicle.max_speed, "v_max")
    if vehicle.min_speed > 0:
        _limit(plot, vehicle.min_speed, "v_min")
    plot.plot(solution.t, _lengths(solution.v), color=_PLAN, label="planned")
    if conversion is not None:
        track = conversion.schedule.track()
        t = track["predicted_t"]
        inside = (t >= solution.t[0]) & (t <= solution.t[-1])
        speed = _lengths(track["predicted_v"])[inside]
        plot.plot(t[inside], speed, color=_PREDICTED, linewidth=1.1, label="predicted")
    plot.set_ylim(bottom=0)
    label(plot, "Speed", "time, s", "speed, m/s")
    plot.legend(loc="best", ncols=2)


def _rate(plot: "Axes", solution: Solution, prediction: Prediction | None) -> None:
    links = (("to UAV", solution.I_U, _PLAN), ("to user", solution.I_G, _OTHER))
    for name, planned, colour in links:
        plot.plot(solution.t, planned, color=colour, label=f"{name}, planned")
    if prediction is not None:
        flown = (("to UAV", prediction.I_U, _PLAN), ("to user", prediction.I_G, _OTHER))
        for name, values, colour in flown:
            plot.plot(
                solution.t, values, "--", color=colour, linewidth=1.1, label=f"{name}, predicted"
            )
    plot.set_ylim(bottom=0)
    label(plot, "Rates of both links", "time, s", "rate, bit/s/Hz")
    plot.legend(loc="best", ncols=2)


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
