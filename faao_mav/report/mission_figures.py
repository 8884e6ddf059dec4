"""The figures of a mission by itself: the map of its predicted flight, and how it flies."""

from typing import TYPE_CHECKING

import numpy as np

from faao_mav.mission.command import FLOWN_TO
from faao_mav.mission.item import Mission
from faao_mav.report.route_map import draw_fence, outlines_of, show_all
from faao_mav.report.style import INK, SERIES, label, legend_above, new_figure, styled
from faao_mav.vehicle.track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH = 4.2
_NUMBERS = 40
"""Items whose numbers are written beside them, at most, evenly chosen."""


def mission_map(mission: Mission, track: Track) -> "Figure":
    """Return the map: the predicted flight, the places of the items with numbers, the fence.

    East and north in metres about the origin of the track's frame; items count from 1.
    """
    found = [
        (number, *track.frame.to_local(item.x, item.y))
        for number, item in enumerate(mission.items, 1)
        if item.command in FLOWN_TO and (item.x or item.y)
    ]
    places = np.array([place for _, *place in found], dtype=float).reshape(-1, 2)
    with styled():
        figure = new_figure(_WIDTH, 4.2)
        plot = figure.subplots()
        outlines = list(outlines_of(mission.fence, track.frame))
        draw_fence(plot, outlines)
        plot.plot(*track.position[:, :2].T, color=SERIES[0], label="predicted")
        plot.plot(*places.T, ".", color=INK, markersize=4, linestyle="none", label="item")
        for number, east, north in found[:: 1 + len(found) // _NUMBERS]:
            plot.annotate(
                str(number), (east, north), (3, 3), textcoords="offset points", fontsize=7
            )
        legend_above(plot, 2)
        plot.set_aspect("equal", adjustable="datalim")
        show_all(plot, np.concatenate([track.position[:, :2], places]), outlines)
        label(plot, "", "east, m", "north, m")
        return figure


def mission_motion(track: Track) -> "Figure":
    """Return ground speed, m/s, and height above home, m, over time, s."""
    with styled():
        figure = new_figure(_WIDTH, 4.4)
        upper, lower = figure.subplots(2, 1, sharex=True)
        upper.plot(track.t, np.hypot(*track.velocity[:, :2].T), color=SERIES[0])
        label(upper, "", "", "ground speed, m/s")
        lower.plot(track.t, track.position[:, 2], color=SERIES[0])
        label(lower, "", "time, s", "height above home, m")
        return figure
