"""Maps: of a plan's route with its speeds, and of a mission alone, each with what is about it."""

import itertools
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import Track
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import FLOWN_TO, Command
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import areas_of
from faao_mav.mission.item import Mission
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.report.style import (
    INK,
    MUTED,
    SERIES,
    WIDTH,
    drawing,
    label,
    legend_above,
    mark_stations,
    write_beside,
)
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.prediction import Prediction
from faao_mav.schedule.transit import way_home, way_out
from faao_mav.vector import lengths

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Outline: TypeAlias = tuple[Real, bool]
"""Corners (k, 2), m, closed, and whether the aircraft has to stay inside."""

_WAYPOINTS = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)
"""The commands of a relay route, whose items are numbered on its map."""

_PIECES = 240  # pieces of the route with a colour each, at most: more cannot be told apart
_LEVELS = 32  # colours on the scale of speeds; chosen: the steps cannot be seen
_SHADES = (0.85, 0.3)  # slow and fast on viridis, whose ends vanish on white and on black paper

_BESIDE = 9.0  # points from a waypoint to the middle of its number; chosen: clear of a route's line
_APART = 0.045  # least distance of two waypoints with numbers, of what is shown; chosen to be read


def route_map(
    solution: Solution,
    conversion: Conversion | None,
    plot: "Axes",
    title: str = "",
    flown: Prediction | None = None,
) -> None:
    """Draw the map on `plot`: east and north in metres, speeds as colours with a bar.

    It shows all of the flight and both stations, and of a wider fence what is near them.
    """
    radio, origin = solution.plan.radio, solution.plan.origin
    stations = np.array([radio.base_station.position, radio.ground_user.position])
    marked = zip(("base station", "user"), stations.tolist(), "s^", strict=True)
    frame = LocalFrame(origin.latitude, origin.longitude)
    fence = conversion.mission.fence if conversion is not None else solution.plan.geofence
    outlines = _outlines_of(fence, frame)
    lines, places = [solution.w], np.empty((0, 2))
    numbers: list[int] = []
    if conversion is not None:
        numbers, places = _places_of(conversion.mission, frame, _WAYPOINTS)
        lines.append(conversion.schedule.track()["predicted_w"])
        lines += _ways(solution.plan, conversion) if outlines else ()
    real = [flown.w] if flown is not None else []
    _draw_fence(plot, outlines)
    _draw_margin(plot, solution.plan)
    _coloured(plot, solution)
    for path in real:
        plot.plot(*path.T, color=SERIES[1], linewidth=1.6, label="flown")
    if conversion is not None:
        plot.plot(*lines[1].T, "--", color=INK, linewidth=0.9, label="predicted")
        for way, name in zip(lines[2:], ("from and to home", None), strict=False):
            plot.plot(*way.T, color=MUTED, linewidth=0.9, label=name)
        _draw_waypoints(plot, places, "waypoint")
    _show_all(plot, np.concatenate([*lines, *real, stations, places]), outlines, title)
    _write_numbers(plot, numbers, places)
    mark_stations(plot, list(marked))  # their names above the numbers


def mission_map(mission: Mission, track: Track) -> "Figure":
    """Return the map: the predicted flight, the places of the items with numbers, the fence.

    East and north in metres about the origin of the track's frame; items count from 1.
    """
    flown = track.position[:, :2]
    numbers, places = _places_of(mission, track.frame, FLOWN_TO)
    with drawing(WIDTH, 4.2) as figure:
        plot = figure.subplots()
        outlines = _outlines_of(mission.fence, track.frame)
        _draw_fence(plot, outlines)
        plot.plot(*flown.T, color=SERIES[0], label="predicted")
        _draw_waypoints(plot, places, "item")
        _show_all(plot, np.concatenate([flown, places]), outlines)
        _write_numbers(plot, numbers, places)
    return figure


def _places_of(
    mission: Mission, frame: LocalFrame, commands: Collection[int]
) -> tuple[list[int], Real]:
    """Return numbers, from 1, and places (k, 2), m, of the items with one of `commands`."""
    found = [
        (number, item.x, item.y)
        for number, item in enumerate(mission.items, 1)
        if item.command in commands and (item.x or item.y)
    ]
    numbers, latitudes, longitudes = zip(*found, strict=True) if found else ((), (), ())
    return list(numbers), frame.to_local(latitudes, longitudes)


def _draw_waypoints(plot: "Axes", places: Real, name: str) -> None:
    """Draw dots at `places` (k, 2), m, and a legend for all that is drawn."""
    plot.plot(*places.T, ".", color=INK, markersize=4, linestyle="none", label=name)
    legend_above(plot, 2)


def _draw_fence(plot: "Axes", outlines: Sequence[_Outline]) -> None:
    """Draw the fence: dashed where the aircraft has to stay inside, filled where outside."""
    names = {True: "stay inside", False: "stay out"}
    for corners, inside in outlines:
        colour, style = (MUTED, "--") if inside else (SERIES[5], "-")
        name = names.pop(inside, None)  # once in the legend
        plot.plot(*corners.T, style, color=colour, linewidth=1.2, label=name)
        if not inside:
            plot.fill(*corners.T, color=colour, alpha=0.15, linewidth=0)


def _ways(plan: Plan, conversion: Conversion) -> Iterator[Real]:
    """Yield the ways (k, 2), m, from home to the route, and back if the mission returns."""
    home, route = np.zeros((1, 2)), conversion.schedule.route.positions
    yield np.vstack([home, way_out(plan, route[0]), route[:1]])
    if plan.mission.on_finish == "rtl":
        yield np.vstack([route[-1:], way_home(plan, route[-1]), home])


def _draw_margin(plot: "Axes", plan: Plan) -> None:
    """Draw how far the plan keeps from the fence's edge: dotted, with its name in the legend."""
    area, fence = plan.keep_in, plan.fence
    if area is None or fence is None:
        return
    name: str | None = f"margin {fence.margin:g} m"
    for edge in area.inside(fence.margin).edges():
        plot.plot(*edge.T, ":", color=MUTED, linewidth=0.9, label=name)
        name = None  # once in the legend


def _show_all(plot: "Axes", seen: Real, outlines: Sequence[_Outline], title: str = "") -> None:
    """Let `plot` show all of `seen` (k, 2), m, and outlines as far as half as wide beyond it.

    A metre is as long to the east as to the north.
    """
    low, high = seen.min(axis=0), seen.max(axis=0)
    width = float((high - low).max()) or 1.0
    if outlines:
        corners = np.concatenate([corners for corners, _ in outlines])
        corners = np.clip(corners, low - width / 2, high + width / 2)
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    plot.set_aspect("equal", adjustable="datalim")
    plot.dataLim.set_points(np.array([low, high]))
    plot.margins(0.08)
    label(plot, title, "east, m", "north, m")


def _coloured(plot: "Axes", solution: Solution) -> None:
    """Draw the planned route, light where it is slow."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap

    step = max(1, -(-(len(solution.w) - 1) // _PIECES))
    ends = np.unique(np.append(np.arange(0, len(solution.w), step), len(solution.w) - 1))
    pieces = [solution.w[a : b + 1] for a, b in itertools.pairwise(ends)]
    speeds = lengths(solution.v)
    means = np.array([speeds[a : b + 1].mean() for a, b in itertools.pairwise(ends)])
    colours = ListedColormap(colormaps["viridis"](np.linspace(*_SHADES, _LEVELS)))
    lines = LineCollection(pieces, cmap=colours, linewidths=5, capstyle="round")
    lines.set_array(means)
    lines.set_clim(0, max(round(float(means.max()), 2), 0.01))  # round: labelled at its end
    plot.add_collection(lines)
    figure = plot.get_figure()
    assert figure is not None
    bar = figure.colorbar(lines, ax=plot, label="planned speed, m/s", shrink=0.7)
    if bar.solids is not None:
        bar.solids.set_edgecolor("face")  # else hairlines of paper between the shades


def _outlines_of(fence: Fence, frame: LocalFrame) -> list[_Outline]:
    """Return the areas of `fence` in metres about `frame`'s origin."""
    areas = areas_of(fence, frame)
    return [(ring, area.inclusion) for area in areas for ring in area.rings()]


def _write_numbers(plot: "Axes", numbers: Sequence[int], places: Real) -> None:
    """Write `numbers` beside their `places` (k, 2), m, on a map of which the limits are known.

    A number stands right of the way. Where one is near already, it is left out.
    """
    least = _APART * np.ptp(plot.dataLim.get_points(), axis=0).max()
    ways = np.gradient(places, axis=0) if len(places) > 1 else np.ones_like(places)
    written = np.empty((0, 2))
    for number, place, (east, north) in zip(numbers, places, ways, strict=True):
        if not (lengths(written - place) < least).any():
            written = np.vstack([written, place])
            side = _BESIDE * np.array([north, -east]) / (float(np.hypot(east, north)) or 1.0)
            write_beside(plot, str(number), place, side, fontsize=8, ha="center", va="center")
