"""The figures of one flight, of a plan or of a mission alone: m, s, m/s, bit/s/Hz, watts."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.shadowing import arriving
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.report.maps import mission_map, route_map
from faao_mav.report.style import MUTED, SERIES, WIDTH, drawing, label, legend_above
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.prediction import Prediction
from faao_mav.validate import Check
from faao_mav.vector import lengths
from faao_mav.workflow import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from faao_mav.report.debrief import FromLog

_COLOURS = {"planned": SERIES[0], "predicted": SERIES[1], "flown": SERIES[2]}
"""Of the curves of these names, in all plots; of others by their order."""


class Shown(NamedTuple):
    """A figure of the page: its heading, and what it shows."""

    heading: str
    figure: "Figure"
    title: str


class _Plot(NamedTuple):
    """A plot over time, s: what it shows with the unit, and by their names curves.

    A curve is its times and values; `limits` are values that the curves are to keep; a `band` has
    its name, its times, and the values between which it lies.
    """

    what: str
    curves: Mapping[str, tuple[Real, Real]]
    limits: Mapping[str, float] = MappingProxyType({})
    band: tuple[str, Real, Real, Real] | None = None


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
        flights = _flights(solution, prediction)
        _draw(column, _speed(solution, conversion), *_hops(solution, flights))
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


def mission_figures(check: Check, *, alone: bool) -> Iterator[Shown]:
    """Yield those of a mission: its map and its motion where it is `alone`, and its energy."""
    if alone and (track := check.track) is not None:
        title = "Map of the predicted flight with the mission's items and its fence, metres"
        yield Shown("Mission", mission_map(check.mission, track), title)
        speed = _Plot("ground speed, m/s", {"": (track.t, lengths(track.velocity[:, :2]))})
        height = _Plot("height above home, m", {"": (track.t, track.position[:, 2])})
        title = "Predicted ground speed and height above home over time"
        yield Shown("Flight", _figure(speed, height), title)
    if (use := check.energy) is not None:
        what, stored = "energy that is used", _Plot("used, Wh", {"": (use.t, use.used)})
        if use.battery is not None:
            full = use.battery.capacity_wh
            reserve = {"reserve": full - use.battery.usable}
            what = "energy that is left"
            stored = _Plot("left, Wh", {"": (use.t, full - use.used)}, reserve)
        title = f"Power of the whole predicted flight over time, and the {what}"
        figure = _figure(_Plot("power, W", {"": (use.t, use.power)}), stored)
        yield Shown("Energy", figure, title)


def plan_figures(result: Result, log: "FromLog | None" = None) -> Iterator[Shown]:
    """Yield those of a plan: as planned, as its mission is predicted, and as flown in a `log`."""
    solution, conversion, prediction = result.solution, result.conversion, result.prediction
    plan, t, rate = solution.plan, solution.t, solution.plan.radio.maximised
    flown = log.found.flown if log is not None else None
    flights = _flights(solution, prediction, flown)
    (east, north), (to_east, to_north) = plan.flight.start, plan.flight.end
    title = (
        f"Map of the route from ({east:g}, {north:g}) to ({to_east:g}, {to_north:g}), east and "
        "north in metres, coloured by speed, with stations, waypoints by item number, flights and "
        "the fence"
    )
    yield Shown("Route", route_figure(solution, conversion, flown), title)
    if log is not None:
        apart = {"predicted": log.found.predicted, "flown": log.found.flown}
        off = {name: (t, lengths(each.w - solution.w)) for name, each in apart.items()}
        title = "Distance from the planned place at equal times, as predicted and as flown"
        figure = _figure(_Plot("distance from the plan, m", off))
        yield Shown("Off the plan", figure, title)
    first = 0 if plan.flight.bound_first_acceleration else 1  # the paper leaves a(0) unbounded
    needed = {"planned": (t[first:], lengths(solution.a)[first:])}
    acceleration = _Plot("acceleration, m/s²", needed, {"a_max": plan.vehicle.max_acceleration})
    title = "Speed and acceleration over time, with their limits"
    yield Shown("Motion", _figure(_speed(solution, conversion), acceleration), title)
    hops = _figure(*_hops(solution, flights), sharey=True)
    yield Shown("Link", hops, "Rates of both links over time")
    held, unit = of_a_slot(plan)
    waiting = {name: (t, held * flight.relayed.queue) for name, flight in flights.items()}
    buffer = {"buffer": most} if (most := plan.radio.relay.buffer_mbytes) else {}
    shared = ", both hops sharing each slot" if plan.radio.duplex == "half" else ""
    title = f"What the relay has received and not yet forwarded, over time{shared}"
    yield Shown("Queue", _figure(_Plot(f"waiting, {unit}", waiting, buffer)), title)
    if (under := result.shadowed) is not None:
        rates = np.stack([solution.I_U, solution.I_G])
        arrived = held * arriving(solution.problem, rates, solution.shares)
        low, half, high = (held * under.arrived[part] for part in (0.1, 0.5, 0.9))
        after = t + plan.flight.time_step
        arrival = _Plot(
            f"arrived, {unit}",
            {"planned": (after, arrived), "median": (after, half)},
            band=("8 of 10", after, low, high),
        )
        title = f"What has arrived over time, as {rate} counts it: planned without shadowing; "
        title += "with it the median, and in the band eight of ten, one above, one below"
        yield Shown("What arrives", _figure(arrival), title)
    begun, ended = solution.history[0], solution.history[-1]
    title = f"{rate} after each iteration, from {begun:.4f} to {ended:.4f} bit/s/Hz"
    yield Shown("Convergence", _convergence(solution), title)
    title = "Power on each stream over time, base station and UAV, strongest stream first"
    yield Shown("Precoders", _precoder_power(solution), title)


def _precoder_power(solution: Solution) -> "Figure":
    """Return the power on each stream, the squared norm of each column of P_B and P_U, over time.

    Streams are numbered by their power in each slot: the rate does not depend on their order.
    Precoders that know the draw are averaged over the draws.
    """
    radio, plots = solution.plan.radio, []
    for station, P, limit, power in (
        ("base station", solution.P_B, "W_B", radio.base_station.power),
        ("UAV", solution.P_U, "W_U", radio.relay.power),
    ):
        found = np.sort(np.sum(np.abs(P) ** 2, axis=-2), axis=-1)[..., ::-1]
        streams = found.mean(axis=0) if found.ndim == 3 else found  # (n, streams), W
        curves = {f"stream {k}": (solution.t, each) for k, each in enumerate(streams.T, 1)}
        plots.append(_Plot(f"{station}, W", curves, {limit: power}))
    return _figure(*plots)


def _convergence(solution: Solution) -> "Figure":
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


def of_a_slot(plan: Plan) -> tuple[float, str]:
    """Return how much a bit/s/Hz is over a slot: bits per hertz, or megabytes with a bandwidth."""
    megahertz, step = plan.radio.bandwidth_mhz, plan.flight.time_step
    return (step, "bit/Hz") if megahertz is None else (step * megahertz / 8, "megabytes")


def _flights(
    solution: Solution, prediction: Prediction | None, flown: Prediction | None = None
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
    air = " through the air" if any(solution.plan.wind) else ""
    limits = {"v_max" + (air if vehicle.type == "plane" else ""): vehicle.max_speed}
    if vehicle.min_speed > 0:
        limits["v_min" + air] = vehicle.min_speed
    return _Plot("speed, m/s", curves, limits)


def _hops(solution: Solution, flights: Mapping[str, Solution | Prediction]) -> list[_Plot]:
    """Return plots of I_U and of I_G: over known fading, one curve would hide the other."""
    return [
        _Plot(
            f"rate to {end}, bit/s/Hz",
            {name: (solution.t, getattr(flight, rate)) for name, flight in flights.items()},
        )
        for end, rate in (("UAV", "I_U"), ("user", "I_G"))
    ]


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
        if plot.band is not None:
            name, t, low, high = plot.band
            axes.fill_between(t, low, high, color=SERIES[1], alpha=0.25, lw=0, label=name)
        for k, (name, (t, values)) in enumerate(plot.curves.items()):
            colour = _COLOURS.get(name, SERIES[k % len(SERIES)])
            (line,) = axes.plot(t, values, color=colour, label=name)
            if len(plot.curves) > 1:
                line.set(linewidth=1.1 if k else 3.6, alpha=None if k else 0.45)
        last = axes is column[-1]
        label(axes, "", "time, s" if last else "", plot.what)
        axes.tick_params(labelbottom=last)
        if ("" not in plot.curves or plot.limits) and len(plot.curves) <= len(SERIES):
            legend_above(axes)
    for axes in column:  # when all are drawn: it ends the scaling of axes that are shared
        axes.set_ylim(bottom=min(0.0, axes.dataLim.y0))
