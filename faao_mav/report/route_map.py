"""The route on a map: planned with its speeds, predicted, waypoints, stations, fence."""

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.faao.solution import Solution
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.convert import Conversion
from faao_mav.mission.fence import Fence
from faao_mav.plan import Plan
from faao_mav.report.style import INK, MUTED, PAPER, SERIES, label, mark_stations

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Outline: TypeAlias = tuple[Real, bool]
"""Corners (k, 2), m, closed, and whether the aircraft has to stay inside."""

_PIECES = 240
"""Pieces of the route with a colour each, at most: more cannot be told apart."""
_LEVELS = 32
_ROUND = 72
_NUMBERED = 30


def route_map(solution: Solution, conversion: Conversion | None, plot: "Axes") -> None:
    """Draw the map on `plot`: east and north in metres, speeds as colours with a bar."""
    plan = solution.plan
    if conversion is not None:
        for corners, inside in _outlines(conversion.mission.fence, plan):
            colour = MUTED if inside else SERIES[5]
            plot.plot(*corners.T, "--" if inside else "-", color=colour, linewidth=1.2)
            if not inside:
                plot.fill(*corners.T, color=colour, alpha=0.15, linewidth=0)
    _coloured(plot, solution)
    if conversion is not None:
        track = conversion.schedule.track()
        plot.plot(*track["predicted_w"].T, "--", color=SERIES[1], linewidth=1.1, label="predicted")
        _numbered(plot, conversion.schedule.route.positions)
        plot.legend(loc="best")
    radio = plan.radio
    mark_stations(
        plot,
        (
            ("base station", radio.base_station.position, "s"),
            ("user", radio.ground_user.position, "^"),
        ),
    )
    plot.set_aspect("equal", adjustable="datalim")
    plot.margins(0.08)
    label(plot, "Route", "east, m", "north, m")


def _coloured(plot: "Axes", solution: Solution) -> None:
    """Draw the planned route, light where it is slow."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection

    step = max(1, -(-(len(solution.w) - 1) // _PIECES))
    ends = np.unique(np.append(np.arange(0, len(solution.w), step), len(solution.w) - 1))
    pieces = [solution.w[a : b + 1] for a, b in itertools.pairwise(ends)]
    speeds = np.hypot(*solution.v.T)
    means = np.array([speeds[a : b + 1].mean() for a, b in itertools.pairwise(ends)])
    lines = LineCollection(
        pieces, cmap=colormaps["viridis_r"].resampled(_LEVELS), linewidths=3, capstyle="round"
    )
    lines.set_array(means)
    lines.set_clim(0, max(float(means.max()), 1e-9))
    plot.add_collection(lines)
    plot.autoscale_view()
    figure = plot.get_figure()
    assert figure is not None
    figure.colorbar(lines, ax=plot, label="speed, m/s", shrink=0.7)


def _numbered(plot: "Axes", positions: Real) -> None:
    """Mark the waypoints, and number as many as can be read."""
    plot.plot(*positions.T, ".", color=INK, markersize=4, linestyle="none")
    step = -(-len(positions) // _NUMBERED)
    for k in range(0, len(positions), step):
        plot.annotate(
            str(k + 1),
            (float(positions[k, 0]), float(positions[k, 1])),
            xytext=(-4, -4),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=7,
            bbox={"facecolor": PAPER, "edgecolor": "none", "alpha": 0.7, "pad": 0.5},
        )


def _outlines(fence: Fence, plan: Plan) -> Iterator[Outline]:
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
    for polygon in fence.polygons:
        corners = np.array([*polygon.vertices, polygon.vertices[0]])
        yield frame.to_local(corners[:, 0], corners[:, 1]), polygon.inclusion
    angles = np.linspace(0.0, 2 * np.pi, _ROUND + 1)
    for circle in fence.circles:
        center = frame.to_local(*circle.center)
        ring = np.column_stack([np.cos(angles), np.sin(angles)])
        yield center + circle.radius * ring, circle.inclusion
