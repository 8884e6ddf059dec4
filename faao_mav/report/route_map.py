"""The route on a map: planned with its speeds, predicted, waypoints, stations, fence."""

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.optimizer.solution import Solution
from faao_mav.report.style import INK, MUTED, SERIES, label, legend_above, mark_stations
from faao_mav.report.waypoint_numbers import waypoints
from faao_mav.schedule.conversion import Conversion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Outline: TypeAlias = tuple[Real, bool]
"""Corners (k, 2), m, closed, and whether the aircraft has to stay inside."""

_PIECES = 240
"""Pieces of the route with a colour each, at most: more cannot be told apart."""
_LEVELS = 32
_SHADES = (0.85, 0.3)
"""Slow and fast on the scale of viridis: its ends vanish on white and on black paper."""
_ROUND = 72


def route_map(solution: Solution, conversion: Conversion | None, plot: "Axes") -> None:
    """Draw the map on `plot`: east and north in metres, speeds as colours with a bar.

    It shows all of the flight and both stations, and of a wider fence what is near them.
    """
    plan = solution.plan
    radio = plan.radio
    stations = np.array([radio.base_station.position, radio.ground_user.position])
    seen = [solution.w, stations]
    outlines: list[Outline] = []
    if conversion is not None:
        frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
        outlines = list(outlines_of(conversion.mission.fence, frame))
        draw_fence(plot, outlines)
    _coloured(plot, solution)
    if conversion is not None:
        track = conversion.schedule.track()["predicted_w"]
        plot.plot(*track.T, "--", color=INK, linewidth=0.9, label="predicted")
        _, places = waypoints(conversion.mission, plan)
        plot.plot(*places.T, ".", color=INK, markersize=4, linestyle="none", label="waypoint")
        legend_above(plot, 2)
        seen += [track, places]
    mark_stations(
        plot,
        (
            ("base station", radio.base_station.position, "s"),
            ("user", radio.ground_user.position, "^"),
        ),
    )
    plot.set_aspect("equal", adjustable="datalim")
    show_all(plot, np.concatenate(seen), outlines)
    label(plot, "", "east, m", "north, m")


def draw_fence(plot: "Axes", outlines: Sequence[Outline]) -> None:
    """Draw the fence: dashed where the aircraft has to stay inside, filled where outside."""
    named: set[bool] = set()
    for corners, inside in outlines:
        colour = MUTED if inside else SERIES[5]
        name = "stay inside" if inside else "stay out"
        plot.plot(
            *corners.T,
            "--" if inside else "-",
            color=colour,
            linewidth=1.2,
            label=None if inside in named else name,
        )
        named.add(inside)
        if not inside:
            plot.fill(*corners.T, color=colour, alpha=0.15, linewidth=0)


def show_all(plot: "Axes", seen: Real, outlines: Sequence[Outline]) -> None:
    """Let `plot` show all of `seen` (k, 2), m, and outlines as far as half as wide beyond it."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    width = float((high - low).max()) or 1.0
    if outlines:
        corners = np.concatenate([corners for corners, _ in outlines])
        corners = np.clip(corners, low - width / 2, high + width / 2)
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    plot.dataLim.set_points(np.array([low, high]))
    plot.margins(0.08)


def _coloured(plot: "Axes", solution: Solution) -> None:
    """Draw the planned route, light where it is slow."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap

    step = max(1, -(-(len(solution.w) - 1) // _PIECES))
    ends = np.unique(np.append(np.arange(0, len(solution.w), step), len(solution.w) - 1))
    pieces = [solution.w[a : b + 1] for a, b in itertools.pairwise(ends)]
    speeds = np.hypot(*solution.v.T)
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


def outlines_of(fence: Fence, frame: LocalFrame) -> Iterator[Outline]:
    """Yield the areas of `fence` in metres about `frame`'s origin."""
    for polygon in fence.polygons:
        corners = np.array([*polygon.vertices, polygon.vertices[0]])
        yield frame.to_local(corners[:, 0], corners[:, 1]), polygon.inclusion
    angles = np.linspace(0.0, 2 * np.pi, _ROUND + 1)
    for circle in fence.circles:
        center = frame.to_local(*circle.center)
        ring = np.column_stack([np.cos(angles), np.sin(angles)])
        yield center + circle.radius * ring, circle.inclusion
