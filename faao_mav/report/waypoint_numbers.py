"""The numbers of the waypoints on a map: those that findings name, as many as can be read."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command
from faao_mav.mission.item import Mission
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.schedule.conversion import Conversion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.transforms import Bbox

Box: TypeAlias = tuple[float, float, float, float]
"""Left, bottom, right and top, points."""

_SIZE = 8.0
_DIGIT = 0.66
"""Width of a digit in the widest usual font, of its size."""
_GAP = 5.0
"""Points between a waypoint and its number."""
_CLEAR = 2.5
"""Points between a number and the middle of a line: half the width that routes are drawn with."""
_MARK = 4.0
"""Half of a station's mark, points."""
_SIDES = ((1, -1), (-1, -1), (1, 1), (-1, 1), (0, -1), (0, 1), (1, 0), (-1, 0))


def waypoints(mission: Mission, plan: Plan) -> tuple[list[int], Real]:
    """Return the item numbers of the waypoints, and where they are (k, 2), m."""
    found = [
        (number, item)
        for number, item in enumerate(mission.items, 1)
        if item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)
    ]
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
    places = frame.to_local([item.x for _, item in found], [item.y for _, item in found])
    return [number for number, _ in found], places


def number_waypoints(solution: Solution, conversion: Conversion | None, plot: "Axes") -> None:
    """Write their numbers beside the waypoints of a map that is drawn, with all else around it.

    A number stands clear of the route, of the predicted track, of names and of other numbers. Where
    that leaves it no room, it is left out.
    """
    if conversion is None:
        return
    figure = plot.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # the scale of the map is known only now
    points = 72.0 / figure.dpi
    numbers, places = waypoints(conversion.mission, solution.plan)
    track = conversion.schedule.track()["predicted_w"]
    occupied = np.concatenate(
        [_dense(plot.transData.transform(line) * points) for line in (solution.w, track)]
    )
    paper = _box(plot.get_window_extent(), points)
    taken = [_box(text.get_window_extent(), points) for text in plot.texts]
    radio = solution.plan.radio
    stations = np.array([radio.base_station.position, radio.ground_user.position])
    for x, y in (plot.transData.transform(stations) * points).tolist():
        taken.append((x - _MARK, y - _MARK, x + _MARK, y + _MARK))
    for number, place, at in zip(
        numbers, places.tolist(), plot.transData.transform(places) * points, strict=True
    ):
        width, height = _DIGIT * _SIZE * len(str(number)), _SIZE
        for across, up in _SIDES:
            gap = _GAP if 0 in (across, up) else 0.6 * _GAP
            x = at[0] + across * (width / 2 + gap)
            y = at[1] + up * (height / 2 + gap)
            box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
            if _within(box, paper) and not _covers(box, occupied) and not _meets(box, taken):
                taken.append(box)
                written = plot.annotate(
                    str(number),
                    place,
                    xytext=(x - at[0], y - at[1]),
                    textcoords="offset points",
                    ha="center",
                    va="center",
                    fontsize=_SIZE,
                )
                written.set_in_layout(False)  # the map stays as it was measured
                break


def _dense(line: Real) -> Real:
    """Return points of `line` (n, 2) that are at most about a point apart."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    at = np.linspace(0.0, along[-1], int(along[-1]) + 2)
    return np.stack([np.interp(at, along, x) for x in line.T], axis=-1)


def _box(extent: "Bbox", points: float) -> Box:
    left, bottom, right, top = (points * float(edge) for edge in extent.extents)
    return left, bottom, right, top


def _within(box: Box, paper: Box) -> bool:
    return box[0] >= paper[0] and box[1] >= paper[1] and box[2] <= paper[2] and box[3] <= paper[3]


def _covers(box: Box, points: Real) -> bool:
    x, y = points.T
    across = (x > box[0] - _CLEAR) & (x < box[2] + _CLEAR)
    return bool(np.any(across & (y > box[1] - _CLEAR) & (y < box[3] + _CLEAR)))


def _meets(box: Box, others: Sequence[Box]) -> bool:
    return any(
        box[0] < other[2] and other[0] < box[2] and box[1] < other[3] and other[1] < box[3]
        for other in others
    )
