"""The figures of one flight, of a plan or of a mission alone: m, s, m/s, bit/s/Hz, watts."""

from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.autopilot import Track
from faao_mav.optimizer.solution import Solution
from faao_mav.report.maps import route_map
from faao_mav.report.style import MUTED, SERIES, WIDTH, drawing, label, legend_above
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.prediction import Prediction
from faao_mav.validate.energy import EnergyUse
from faao_mav.vector import lengths

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def flight_figure(
    solution: Solution, conversion: Conversion | None = None, prediction: Prediction | None = None
) -> "Figure":
    """Return the flight in one figure, as `--figure` saves it: map, speed, and both rates."""
    with drawing(9.6, 5.6) as figure:
        grid = figure.add_gridspec(3, 2, width_ratios=[1.15, 1.0])
        plot = figure.add_subplot(grid[:, 0])
        speed = figure.add_subplot(grid[0, 1])
        to_uav = figure.add_subplot(grid[1, 1], sharex=speed)
        to_user = figure.add_subplot(grid[2, 1], sharex=speed, sharey=to_uav)
        _speed(speed, solution, conversion)
        _rates((to_uav, to_user), solution, prediction)
        _share_time(speed, to_uav)
        route_map(solution, conversion, plot, "Route")
    return figure


def route(
    solution: Solution, conversion: Conversion | None = None, flown: Prediction | None = None
) -> "Figure":
    """Return the map of the route: see `route_map`."""
    with drawing(WIDTH, 4.2) as figure:
        route_map(solution, conversion, figure.subplots(), flown=flown)
    return figure


def apart(solution: Solution, prediction: Prediction, flown: Prediction) -> "Figure":
    """Return how far the flight is from the plan at equal times: predicted, and as flown."""
    with drawing(WIDTH, 2.6) as figure:
        plot = figure.subplots()
        for flight, name, colour in ((prediction, "predicted", 1), (flown, "flown", 2)):
            off = lengths(flight.w - solution.w)
            plot.plot(solution.t, off, color=SERIES[colour], linewidth=1.1, label=name)
        plot.set_ylim(bottom=0)
        _over_time(plot, "", "distance from the plan, m")
    return figure


def motion(solution: Solution, conversion: Conversion | None = None) -> "Figure":
    """Return speed and acceleration over time with v_max, v_min and a_max."""
    with drawing(WIDTH, 4.4) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True)
        _speed(upper, solution, conversion)
        _acceleration(lower, solution)
        _share_time(upper)
    return figure


def rates(
    solution: Solution, prediction: Prediction | None = None, flown: Prediction | None = None
) -> "Figure":
    """Return I_U and I_G of (7), (8) in every slot: planned, predicted, flown."""
    with drawing(WIDTH, 4.4) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True, sharey=True)
        _rates((upper, lower), solution, prediction, flown)
        _share_time(upper)
    return figure


def queue(
    solution: Solution, prediction: Prediction | None = None, flown: Prediction | None = None
) -> "Figure":
    """Return what waits in the relay over time: planned, where the flight is predicted, and flown.

    Bits per hertz of bandwidth, or megabytes where the plan has a bandwidth.
    """
    plan = solution.plan
    megabytes = plan.radio.bandwidth_mhz
    bits, unit = (1.0, "bit/Hz") if megabytes is None else (megabytes / 8, "megabytes")
    held = plan.flight.time_step * bits  # of a bit/s/Hz for a slot
    with drawing(WIDTH, 2.6) as figure:
        plot = figure.subplots()
        flights = [
            None if flight is None else (solution.t, held * flight.relayed.queue)
            for flight in (prediction, flown)
        ]
        if plan.radio.relay.buffer_mbytes is not None:
            _limit(plot, plan.radio.relay.buffer_mbytes, "buffer")
        _curves(plot, (solution.t, held * solution.relayed.queue), *flights)
        plot.set_ylim(bottom=0)
        _over_time(plot, "", f"waiting, {unit}")
    return figure


def precoder_power(solution: Solution) -> "Figure":
    """Return the power on each stream, the squared norm of each column of P_B and P_U, over time.

    Streams are numbered by their power in each slot: the rate does not depend on their order.
    Precoders that know the draw are averaged over the draws.
    """
    radio = solution.plan.radio
    base = ("Base station", solution.P_B, radio.base_station.power, "W_B")
    uav = ("UAV", solution.P_U, radio.relay.power, "W_U")
    with drawing(WIDTH, 4.4) as figure:
        plots = figure.subplots(2, 1, sharex=True)
        for plot, (station, P, power, limit) in zip(plots, (base, uav), strict=True):
            streams = _stream_powers(P).T
            unit, scale = _watts(power)
            _limit(plot, power * scale, limit)
            for k, stream in enumerate(streams):
                name, colour = f"stream {k + 1}", SERIES[k % len(SERIES)]
                width = 1.2 if k else 2.4
                plot.plot(solution.t, stream * scale, color=colour, linewidth=width, label=name)
            plot.set_ylim(bottom=0)
            _over_time(plot, station, f"power, {unit}", legend=len(streams) <= len(SERIES))
        _share_time(plots[0])
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
    with drawing(WIDTH, 4.4) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True)
        upper.plot(track.t, lengths(track.velocity[:, :2]), color=SERIES[0])
        label(upper, "", "", "ground speed, m/s")
        lower.plot(track.t, track.position[:, 2], color=SERIES[0])
        label(lower, "", "time, s", "height above home, m")
    return figure


def energy(use: EnergyUse) -> "Figure":
    """Return the power of the whole predicted flight, W, and what is used or left, Wh."""
    with drawing(WIDTH, 4.4) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True)
        upper.plot(use.t, use.power, color=SERIES[1], linewidth=1.1)
        upper.set_ylim(0, 1.05 * float(use.power.max()))
        label(upper, "", "", "power, W")
        _share_time(upper)
        battery = use.battery
        full = 0.0 if battery is None else battery.capacity_wh
        lower.plot(use.t, full - use.used if battery else use.used, color=SERIES[1])
        if battery is not None:
            _limit(lower, full - battery.usable, "reserve")
            legend_above(lower)
        lower.set_ylim(bottom=min(0.0, full - use.total))
        label(lower, "", "time, s", "used, Wh" if battery is None else "left, Wh")
    return figure


def _speed(plot: "Axes", solution: Solution, conversion: Conversion | None) -> None:
    vehicle = solution.plan.vehicle
    _limit(plot, vehicle.max_speed, "v_max")
    if vehicle.min_speed > 0:
        _limit(plot, vehicle.min_speed, "v_min")
    flown = None
    if conversion is not None:
        schedule = conversion.schedule
        track = schedule.track()
        t = track["predicted_t"]
        over = solution.t[-1] + max(0.0, schedule.clock.late(schedule.flown))
        inside = (t >= solution.t[0]) & (t <= over)
        flown = t[inside], lengths(track["predicted_v"])[inside]
    _curves(plot, (solution.t, lengths(solution.v)), flown)
    plot.set_ylim(bottom=0)
    _over_time(plot, "Speed", "speed, m/s")


def _acceleration(plot: "Axes", solution: Solution) -> None:
    limit, needed = solution.plan.vehicle.max_acceleration, lengths(solution.a)
    _limit(plot, limit, "a_max")
    _curves(plot, (solution.t, needed))
    plot.set_ylim(bottom=0)
    top = 1.2 * max(limit, float(needed[1:].max()))
    if needed[0] > top:  # a(0) has no bound in the paper: it would flatten all the rest
        plot.set_ylim(top=top)
        plot.annotate(
            f"a(0): {needed[0]:.3g} m/s²",
            (0.0, 1.0),
            xytext=(12, -4),
            xycoords=plot.get_xaxis_transform(),
            textcoords="offset points",
            va="top",
        )
    _over_time(plot, "Acceleration", "acceleration, m/s²")


def _rates(
    plots: "tuple[Axes, Axes]",
    solution: Solution,
    prediction: Prediction | None,
    flown: Prediction | None = None,
) -> None:
    """Draw each link on its own plot: over known fading, one would hide the other."""
    t = solution.t
    names = ("Base station to UAV", "UAV to user")
    hops = [(solution.I_U, solution.I_G)]
    hops += [(each.I_U, each.I_G) for each in (prediction, flown) if each is not None]
    top = float(np.max(hops)) or 1.0
    for k, (plot, name) in enumerate(zip(plots, names, strict=True)):
        _curves(plot, *((t, values[k]) for values in hops))
        plot.set_ylim(0, 1.08 * top)
        _over_time(plot, name, "rate, bit/s/Hz")


def _curves(
    plot: "Axes",
    planned: tuple[Real, Real],
    predicted: tuple[Real, Real] | None = None,
    flown: tuple[Real, Real] | None = None,
) -> None:
    """Draw a curve of the plan, and as a band beneath them where there are some of flights."""
    alone = predicted is None and flown is None
    beneath: dict[str, Any] = {} if alone else {"linewidth": 3.6, "alpha": 0.45}
    plot.plot(*planned, color=SERIES[0], label="planned", **beneath)
    if predicted is not None:
        plot.plot(*predicted, color=SERIES[1], linewidth=1.1, label="predicted")
    if flown is not None:
        plot.plot(*flown, color=SERIES[2], linewidth=1.1, label="flown")


def _over_time(plot: "Axes", title: str, what: str, *, legend: bool = True) -> None:
    label(plot, title, "time, s", what)
    if legend:
        legend_above(plot)


def _share_time(*upper: "Axes") -> None:
    """Leave the time axis of `upper` to the plot beneath them."""
    for plot in upper:
        plot.set_xlabel("")
        plot.tick_params(labelbottom=False)


def _limit(plot: "Axes", value: float, name: str) -> None:
    plot.axhline(value, color=MUTED, linestyle=":", linewidth=1.2, label=name)


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
