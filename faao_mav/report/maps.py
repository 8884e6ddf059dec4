"""Maps: of a plan's route with its speeds, and of a mission alone, each with what is about it."""

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import Track
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import FLOWN_TO, Command
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import areas_of
from faao_mav.mission.item import Mission
from faao_mav.optimizer.solution import Solution
from faao_mav.report import style
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.prediction import Prediction
from faao_mav.vector import lengths

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WAYPOINTS = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)
"""The commands of a relay route, whose items are numbered on its map."""

_MOST_DRAWN = 400  # points of a line on a map and of a chart: more cannot be told apart. Chosen
_LEVELS = 32  # colours on the scale of speeds; chosen: the steps cannot be seen


def route_map(
    solution: Solution, conversion: Conversion | None, plot: "Axes", flown: Prediction | None = None
) -> None:
    """Draw the map on `plot`, whose figure has all else: speeds as colours with a bar.

    East and north are in metres. It shows all of the flight and both stations, and of a wider fence
    what is near them.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LinearSegmentedColormap

    plan = solution.plan
    stations = [station.at(solution.t) for station in plan.radio.stations]
    frame = plan.origin.frame
    fence = plan.geofence if conversion is None else conversion.mission.fence
    outlines = _draw_fence(plot, fence, frame)
    if plan.keep_in is not None and plan.fence is not None:
        for edge in plan.keep_in.inside(plan.fence.margin).edges():
            name = f"margin {plan.fence.margin:g} m"
            plot.plot(*edge.T, ":", color=style.MUTED, linewidth=0.9, label=name)
    w, speeds = thinned(solution.w), thinned(lengths(solution.v))
    colours = LinearSegmentedColormap.from_list("speeds", style.SPEEDS, _LEVELS)
    pieces = list(np.stack([w[:-1], w[1:]], axis=1))
    means = (speeds[:-1] + speeds[1:]) / 2
    lines = LineCollection(pieces, cmap=colours, linewidths=5, capstyle="round")
    lines.set_array(means)
    lines.set_clim(0, max(round(float(means.max()), 2), 0.01))  # round: labelled at its end
    plot.add_collection(lines)
    style.colour_bar(plot, lines, "planned speed, m/s", 0.7)
    seen, numbers = [solution.w, *stations], []
    if flown is not None:
        seen.append(flown.w)
        plot.plot(*flown.w.T, color=style.SERIES[1], linewidth=1.6, label="flown")
    if conversion is not None:
        seen.append(conversion.schedule.track()["predicted_w"])
        plot.plot(*seen[-1].T, "--", color=style.INK, linewidth=0.9, label="predicted")
        numbers = _draw_items(plot, conversion.mission, frame, WAYPOINTS, "waypoint")
        seen += [place[np.newaxis] for _, place in numbers]
    if any(station.moves for station in plan.radio.stations):  # its way is drawn with its mark
        plot.plot([], [], color=style.INK, linewidth=1.0, label="station moves")
    _show_all(plot, np.concatenate(seen), outlines)
    style.mark_stations(
        plot, list(zip(("base station", "user"), stations, "s^", strict=True)), numbers
    )


def mission_map(mission: Mission, track: Track) -> "Figure":
    """Return the map: the predicted flight, the places of the items with numbers, the fence.

    East and north in metres about the origin of the track's frame; items count from 1.
    """
    flown = track.position[:, :2]
    with style.drawing(style.WIDTH, 4.2) as figure:
        plot = figure.subplots()
        outlines = _draw_fence(plot, mission.fence, track.frame)
        plot.plot(*flown.T, color=style.SERIES[0], label="predicted")
        numbers = _draw_items(plot, mission, track.frame, FLOWN_TO, "item")
        places = [place[np.newaxis] for _, place in numbers]
        _show_all(plot, np.concatenate([flown, *places]), outlines)
        style.write_beside(plot, numbers)
    return figure


def thinned(values: Real) -> Real:
    """Return at most `_MOST_DRAWN` of `values` (n, ...), the first and the last among them."""
    kept = np.linspace(0, len(values) - 1, min(len(values), _MOST_DRAWN)).round().astype(int)
    return np.asarray(values[kept])


def placed_items(
    mission: Mission, commands: Collection[int]
) -> list[tuple[int, tuple[float, float]]]:
    """Return number, from 1, and latitude and longitude of the items with one of `commands`."""
    return [
        (number, (item.x, item.y))
        for number, item in enumerate(mission.items, 1)
        if item.command in commands and (item.x or item.y)
    ]


def _draw_fence(plot: "Axes", fence: Fence, frame: LocalFrame) -> list[Real]:
    """Draw and return the outlines (k, 2), m: dashed to stay inside of, filled to stay out of."""
    outlines = []
    for area in areas_of(fence, frame):
        colour, line = (style.MUTED, "--") if area.inclusion else (style.SERIES[5], "-")
        name = "stay inside" if area.inclusion else "stay out"
        for ring in area.rings():
            outlines.append(ring)
            plot.plot(*ring.T, line, color=colour, linewidth=1.2, label=name)
            if not area.inclusion:
                plot.fill(*ring.T, color=colour, alpha=0.15, linewidth=0)
    return outlines


def _show_all(plot: "Axes", seen: Real, outlines: Sequence[Real]) -> None:
    """Let `plot` show all of `seen` (k, 2), m, and outlines as far as half as wide beyond it.

    A metre is as long to the east as to the north.
    """
    low, high = seen.min(axis=0), seen.max(axis=0)
    width = float((high - low).max()) or 1.0
    if outlines:
        corners = np.clip(np.concatenate(outlines), low - width / 2, high + width / 2)
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    plot.set_aspect("equal", adjustable="datalim")
    plot.dataLim.set_points(np.array([low, high]))
    plot.margins(0.08)
    style.label(plot, "", "east, m", "north, m")
    style.legend_above(plot, 2)


def _draw_items(
    plot: "Axes", mission: Mission, frame: LocalFrame, commands: Collection[int], name: str
) -> list[tuple[str, Real]]:
    """Draw the items of `placed_items`; return their numbers and places (2,), m."""
    found = [
        (str(number), frame.to_local(*place)) for number, place in placed_items(mission, commands)
    ]
    places = np.reshape([place for _, place in found], (-1, 2))
    plot.plot(*places.T, ".", color=style.INK, markersize=4, linestyle="none", label=name)
    return found
