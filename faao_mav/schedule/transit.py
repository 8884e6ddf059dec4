"""The ways between home and the relay route, which keep the plan's margin from the fence's edge."""

from functools import lru_cache

import numpy as np
import shapely

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError, InputError
from faao_mav.mission.fence_area import FreeArea
from faao_mav.plan import Plan
from faao_mav.plan.fence import edge_of, margin_key, trouble
from faao_mav.schedule.route import Route

ROUNDING = 0.012
"""By how much, m, a way may be nearer to the edge than it should: places are sent in 1e-7 degrees,
11 mm."""

_SIMPLER = (4.0, 1.0)
"""By how much, m, a way may keep farther from the edge than it has to, for fewer corners. Chosen:
around a circle of 60 m they are 30 m apart."""


def check_transit(plan: Plan) -> None:
    """Raise where no flight of `plan` gets from home to flight.start, and back if it has to.

    `InputError` for a home that is nearer to the edge than the plan's margin,
    `InfeasibleError` where there is no way.
    """
    way_out(plan, np.array(plan.flight.start))
    way_home(plan, np.array(plan.flight.end))


def way_out(plan: Plan, first: Real) -> Real:
    """Return the corners (k, 2), m, on the way from home to `first` (2,); errors as above."""
    return _corners(plan, np.zeros(2), first, "home (site.origin) to flight.start")


def way_home(plan: Plan, last: Real) -> Real:
    """Return the corners (k, 2), m, after which a return to launch from `last` (2,) is straight.

    There are none unless the mission ends with one. Errors as above.
    """
    if plan.mission.on_finish != "rtl":
        return np.empty((0, 2))
    return _corners(plan, last, np.zeros(2), "flight.end to home (site.origin)")


def way_between(plan: Plan, start: Real, end: Real) -> Real | None:
    """Return the corners (k, 2), m, of a way from `start` to `end`, both (2,), which are its ends.

    It keeps the plan's margin from the edge of the fence, where `start` is nearer to it from the
    nearest place on that does. None where there is no such way inside the fence.
    """
    fence, margin = plan.keep_in, plan.margin
    if fence is None:
        return np.array([start, end])
    kept = _kept(fence, margin)
    if kept.covers_path(np.array([start, end])):
        return np.array([start, end])
    begin = start
    if not kept.covers(start[None]).all():
        within = fence.inside(margin)
        if within.empty:
            return None
        begin = within.nearest(start, end)
        if not fence.covers_path(np.array([start, begin])):
            return None
    way = _way(fence, margin, begin, end)
    return None if way is None else np.vstack([start[None], way])


def check_run_in(plan: Plan, route: Route) -> None:
    """Raise `InfeasibleError` where a leg before w_I or after w_F comes nearer to the edge."""
    fence, last = plan.keep_in, len(route.positions) - 1
    if fence is None:
        return
    area = _kept(fence, plan.margin)
    legs = ((0, route.first, "start"), (route.last, last, "end"))
    for begin, end, name in legs:
        leg = route.positions[begin : end + 1]
        if len(leg) > 1 and not area.covers_path(leg):
            raise InfeasibleError(
                f"{edge_of(plan)}: the aircraft takes {route.leg_lengths[begin]:.0f} m to get up "
                f"to speed before flight.start, or to slow down after flight.end, and at "
                f"flight.{name} that leg comes nearer to the edge than {plan.margin:g} m "
                f"({margin_key(plan)}): give flight.{name}_velocity: hover, or move flight.{name}"
            )


def _corners(plan: Plan, start: Real, end: Real, name: str) -> Real:
    fence, margin = plan.keep_in, plan.margin
    if fence is None:
        return np.empty((0, 2))
    if not _kept(fence, margin).covers(np.zeros((1, 2))).all():
        raise InputError(
            f"{plan.source}: site.origin: home, where the mission takes off, is "
            f"{trouble(plan, (0.0, 0.0))}"
        )
    way = _way(fence, margin, start, end)
    if way is None:
        raise InfeasibleError(
            f"{edge_of(plan)}: no way leads from {name} that keeps {margin:g} m "
            f"({margin_key(plan)}) from the edge; give a smaller margin, move home, or change the "
            f"{edge_of(plan)}"
        )
    return way[1:-1]


def _way(fence: FreeArea, margin: float, start: Real, end: Real) -> Real | None:
    """Return the corners (k, 2) of a short way with few of them: the aircraft stops at each.

    It keeps the `margin`, m, from the edge of `fence`. None where there is no way.
    """
    area = _kept(fence, margin)
    for simpler in _SIMPLER:
        offset = -(margin + simpler)
        coarse = fence.shape.buffer(offset, join_style="mitre", mitre_limit=2).simplify(simpler)
        if coarse.is_empty:
            continue
        places = shapely.points(np.array([start, end]))
        links = shapely.get_coordinates(shapely.shortest_line(coarse, places))[::2]
        middle = FreeArea(coarse).shortest_way(*links)
        if middle is not None and area.covers_path(np.vstack([start, middle, end])):
            return _straightened(area, np.vstack([start, middle, end]))
    return area.shortest_way(start, end)


def _straightened(area: FreeArea, way: Real) -> Real:
    """Return `way` (k, 2) without the corners that the straight past them makes needless."""
    kept = [0]
    for k in range(1, len(way) - 1):
        if not area.covers_path(way[[kept[-1], k + 1]]):
            kept.append(k)
    return way[[*kept, -1]]


@lru_cache(maxsize=8)
def _kept(fence: FreeArea, margin: float) -> FreeArea:
    """Return where a `fence` and a `margin`, m, let the aircraft be."""
    return fence.inside(max(margin - ROUNDING, 0.0))
