"""The figures of one flight, of a plan or of a mission alone: m, s, m/s, bit/s/Hz, watts."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import Track
from faao_mav.optimizer.shadowing import Shadowed, arriving
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.report.maps import route_map
from faao_mav.report.style import MUTED, SERIES, WIDTH, drawing, label, legend_above
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.prediction import Prediction
from faao_mav.validate.demands import EnergyUse
from faao_mav.vector import lengths

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_COLOURS = {"planned": SERIES[0], "predicted": SERIES[1], "flown": SERIES[2]}
"""Of the curves of these names, in all plots; of others by their order."""


class _Plot(NamedTuple):
    """A plot over time, s: what it shows with the unit, and by their names curves.

    A curve is its times and values; `limits` are values that the curves are to keep.
    """

    what: str
    curves: Mapping[str, tuple[Real, Real]]
    limits: Mapping[str, float] = MappingProxyType({})


def flight_figure(
    solution: Solution, conversion: Conversion | None = None, prediction: Prediction | None = None
) -> "Figure":
    """Return the flight in one figure, as `--figure` saves it: map, speed, and both rates.

    >>> from faao_mav import optimize, read_plan
    >>> figure = flight_figure(optimize(read_plan("missions/copter_relay.yaml")))
    >>> figure.axes[1].get_ylabel()
    'speed, m/s'
    """
    with drawing(9.6, 5.6) as figure:
        grid = figure.add_gridspec(3, 2, width_ratios=[1.15, 1.0])
        plot = figure.add_subplot(grid[:, 0])
        column = [figure.add_subplot(grid[0, 1])]
        column += [figure.add_subplot(grid[k, 1], sharex=column[0]) for k in (1, 2)]
        column[2].sharey(column[1])
        _draw(column, _speed(solution, conversion), *_hops(solution, prediction))
        route_map(solution, conversion, plot)
    return figure


def route_figure(
    solution: Solution, conversion: Conversion | None = None, flown: Prediction | None = None
) -> "Figure":
    """Return the map of the route: see `route_map`.

    >>> from faao_mav import optimize, read_plan
    >>> route_figure(optimize(read_plan("missions/copter_relay.yaml"))).axes[0].get_xlabel()
    'east, m'
    """
    with drawing(WIDTH, 4.2) as figure:
        route_map(solution, conversion, figure.subplots(), flown)
    return figure


def apart(solution: Solution, prediction: Prediction, flown: Prediction) -> "Figure":
    """Return how far the flight is from the plan at equal times: predicted, and as flown."""
    flights = {"predicted": prediction, "flown": flown}
    off = {name: (solution.t, lengths(each.w - solution.w)) for name, each in flights.items()}
    return _figure(_Plot("distance from the plan, m", off))


def motion(solution: Solution, conversion: Conversion | None = None) -> "Figure":
    """Return speed and acceleration over time with v_max, v_min and a_max.

    Of a plan that leaves a(0) unbounded, as the paper does, that is left out.
    """
    plan = solution.plan
    first = 0 if plan.flight.bound_first_acceleration else 1
    needed = solution.t[first:], lengths(solution.a)[first:]
    limit = {"a_max": plan.vehicle.max_acceleration}
    return _figure(
        _speed(solution, conversion),
        _Plot("acceleration, m/s²", {"planned": needed}, limit),
    )


def rates(
    solution: Solution, prediction: Prediction | None = None, flown: Prediction | None = None
) -> "Figure":
    """Return I_U and I_G of (7), (8) in every slot: planned, predicted, flown."""
    return _figure(*_hops(solution, prediction, flown), sharey=True)


def queue(
    solution: Solution, prediction: Prediction | None = None, flown: Prediction | None = None
) -> "Figure":
    """Return what waits in the relay over time: planned, where the flight is predicted, and flown.

    Bits per hertz of bandwidth, or megabytes where the plan has a bandwidth.
    """
    buffer = solution.plan.radio.relay.buffer_mbytes
    held, unit = _of_a_slot(solution.plan)
    curves = {
        name: (solution.t, held * flight.relayed.queue)
        for name, flight in _flights(solution, prediction, flown).items()
    }
    return _figure(_Plot(f"waiting, {unit}", curves, {"buffer": buffer} if buffer else {}))


def arrival(solution: Solution, under: Shadowed) -> "Figure":
    """Return what has arrived over time: planned, and under shadowing with a band of 0.1 to 0.9."""
    held, unit = _of_a_slot(solution.plan)
    t = solution.t + solution.plan.flight.time_step
    planned = arriving(solution.problem, np.stack([solution.I_U, solution.I_G]), solution.shares)
    with drawing(WIDTH, 2.6) as figure:
        plot = figure.subplots()
        plot.plot(t, held * planned, color=SERIES[0], label="planned")
        low, half, high = (held * under.arrived[part] for part in (0.1, 0.5, 0.9))
        plot.fill_between(t, low, high, color=SERIES[1], alpha=0.25, lw=0, label="8 of 10")
        plot.plot(t, half, color=SERIES[1], label="median")
        plot.set_ylim(bottom=0.0)
        label(plot, "", "time, s", f"arrived, {unit}")
        legend_above(plot)
    return figure


def precoder_power(solution: Solution) -> "Figure":
    """Return the power on each stream, the squared norm of each column of P_B and P_U, over time.

    Streams are numbered by their power in each slot: the rate does not depend on their order.
    Precoders that know the draw are averaged over the draws.
    """
    from matplotlib.ticker import EngFormatter

    radio, plots = solution.plan.radio, []
    for station, P, limit, power in (
        ("base station", solution.P_B, "W_B", radio.base_station.power),
        ("UAV", solution.P_U, "W_U", radio.relay.power),
    ):
        found = np.sort(np.sum(np.abs(P) ** 2, axis=-2), axis=-1)[..., ::-1]
        streams = found.mean(axis=0) if found.ndim == 3 else found  # (n, streams), W
        curves = {f"stream {k}": (solution.t, each) for k, each in enumerate(streams.T, 1)}
        plots.append(_Plot(f"{station}, W", curves, {limit: power}))
    figure = _figure(*plots)
    for axes in figure.axes:
        axes.yaxis.set_major_formatter(EngFormatter("W"))
    return figure


def convergence(solution: Solution) -> "Figure":
    """Return the rate that the plan maximises, R_avg or R_del, after each iteration."""
    from matplotlib.ticker import MaxNLocator

    with drawing(WIDTH, 2.6) as figure:
        plot = figure.subplots()
        steps = np.arange(len(solution.history))
        plot.plot(steps, solution.history, color=SERIES[0], marker="o", markersize=3.5)
        plot.xaxis.set_major_locator(MaxNLocator(integer=True))
        plot.ticklabel_format(axis="y", useOffset=False)
        label(plot, "", "iteration", f"rate {solution.plan.radio.maximised}, bit/s/Hz")
    return figure


def mission_motion(track: Track) -> "Figure":
    """Return ground speed, m/s, and height above home, m, over time, s."""
    return _figure(
        _Plot("ground speed, m/s", {"": (track.t, lengths(track.velocity[:, :2]))}),
        _Plot("height above home, m", {"": (track.t, track.position[:, 2])}),
    )


def energy(use: EnergyUse) -> "Figure":
    """Return the power of the whole predicted flight, W, and what is used or left, Wh."""
    stored = _Plot("used, Wh", {"": (use.t, use.used)})
    if use.battery is not None:
        full = use.battery.capacity_wh
        reserve = {"reserve": full - use.battery.usable}
        stored = _Plot("left, Wh", {"": (use.t, full - use.used)}, reserve)
    return _figure(_Plot("power, W", {"": (use.t, use.power)}), stored)


def _of_a_slot(plan: Plan) -> tuple[float, str]:
    """Return how much a bit/s/Hz is over a slot: bits per hertz, or megabytes with a bandwidth."""
    megahertz, step = plan.radio.bandwidth_mhz, plan.flight.time_step
    return (step, "bit/Hz") if megahertz is None else (step * megahertz / 8, "megabytes")


def _flights(
    solution: Solution, prediction: Prediction | None, flown: Prediction | None
) -> dict[str, Solution | Prediction]:
    """Return those that there are by the name of their curves."""
    flights = {"planned": solution, "predicted": prediction, "flown": flown}
    return {name: flight for name, flight in flights.items() if flight is not None}


def _speed(solution: Solution, conversion: Conversion | None) -> _Plot:
    vehicle, curves = solution.plan.vehicle, {"planned": (solution.t, lengths(solution.v))}
    if conversion is not None:
        schedule = conversion.schedule
        track = schedule.track()
        t = track["predicted_t"]
        over = solution.t[-1] + max(0.0, schedule.late)
        inside = (t >= solution.t[0]) & (t <= over)
        curves["predicted"] = t[inside], lengths(track["predicted_v"])[inside]
    limits = {"v_max": vehicle.max_speed}
    if vehicle.min_speed > 0:
        limits["v_min"] = vehicle.min_speed
    return _Plot("speed, m/s", curves, limits)


def _hops(
    solution: Solution, prediction: Prediction | None, flown: Prediction | None = None
) -> tuple[_Plot, _Plot]:
    """Return each link's plot: over known fading, one would hide the other."""
    flights = _flights(solution, prediction, flown)
    to_uav = {name: (solution.t, flight.I_U) for name, flight in flights.items()}
    to_user = {name: (solution.t, flight.I_G) for name, flight in flights.items()}
    return (
        _Plot("rate to UAV, bit/s/Hz", to_uav),
        _Plot("rate to user, bit/s/Hz", to_user),
    )


def _figure(*plots: _Plot, sharey: bool = False) -> "Figure":
    """Return `plots` beneath one another."""
    with drawing(WIDTH, 2.6 if len(plots) == 1 else 4.4) as figure:
        column = figure.subplots(len(plots), 1, sharex=True, sharey=sharey, squeeze=False)[:, 0]
        _draw(column.tolist(), *plots)
    return figure


def _draw(column: "list[Axes]", *plots: _Plot) -> None:
    """Draw `plots` on a `column` of axes that share their time.

    The first of several curves is a band beneath the others, which may be the same.
    """
    for axes, plot in zip(column, plots, strict=True):
        for name, value in plot.limits.items():
            axes.axhline(value, color=MUTED, linestyle=":", linewidth=1.2, label=name)
        for k, (name, (t, values)) in enumerate(plot.curves.items()):
            colour = _COLOURS.get(name, SERIES[k % len(SERIES)])
            (line,) = axes.plot(t, values, color=colour, label=name)
            if len(plot.curves) > 1:
                line.set(linewidth=1.1 if k else 3.6, alpha=None if k else 0.45)
        axes.set_ylim(bottom=min(0.0, axes.dataLim.y0))
        last = axes is column[-1]
        label(axes, "", "time, s" if last else "", plot.what)
        axes.tick_params(labelbottom=last)
        if ("" not in plot.curves or plot.limits) and len(plot.curves) <= len(SERIES):
            legend_above(axes)
