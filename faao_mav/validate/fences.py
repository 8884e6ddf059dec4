"""The fence: what of the mission leaves it, how near it comes, whether the vehicle keeps it."""

from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.fence import RallyPoint
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.fence_map import FenceMap
from faao_mav.validate.rule import Checks, Hits, at
from faao_mav.vector import lengths

checks = Checks()

LEAST_MARGIN = 2.0
"""The distance to the fence, m, below which the error of the aircraft's position counts. Chosen;
what a change costs is not measured."""

_NAMED = 3
"""Parts of the fence that a way is told to break, at most. Chosen: more help nobody."""

_STILL = 0.1
"""The speed, m/s, below which an aircraft heads nowhere. Chosen."""


@checks("fence-crosses-itself")
def _(context: ValidationContext) -> Hits:
    areas = (area for fence in context.fences for area in fence.areas)
    return (at(name=area.name) for area in areas if area.crosses_itself)


@checks("fence-home")
def _(context: ValidationContext) -> Hits:
    then = context.vehicle.type.home_outside_fence
    for fence in context.fences if context.home is not None else ():
        if where := _where(fence, (0.0, 0.0)):
            yield at(where=where, then=f"; {then}" if then else "")


@checks("fence-rally")
def _(context: ValidationContext) -> Hits:
    for fence in context.fences:
        for n, point in enumerate(context.mission.rally, start=1):
            if where := _where(fence, _local(fence, point)):
                yield at(n=n, where=where)


@checks("fence-return")
def _(context: ValidationContext) -> Hits:
    point = context.mission.fence.breach_return
    for fence in context.fences:
        if point is not None and (where := _where(fence, _local(fence, point))):
            yield at(where=where)


def _local(fence: FenceMap, point: RallyPoint) -> Real:
    return fence.frame.to_local(point.latitude, point.longitude)


def _where(fence: FenceMap, place: Any) -> str:
    """Return where `place` (2,), m, is if it is not within the fence, else ""."""
    import shapely

    return _broken(fence, shapely.Point(place))


def _broken(fence: FenceMap, shape: Any) -> str:
    """Return in words which parts of the fence `shape` breaks, "" if none."""
    return " and ".join(broken for broken, _ in islice(fence.broken_by(shape), _NAMED))


@checks("fence-leg")
def _(context: ValidationContext) -> Hits:
    for fence in context.fences:
        for k in np.flatnonzero(fence.legs.leave).tolist():
            leg = context.legs[k]
            broken = islice(fence.broken_by(fence.legs.shapes[k]), _NAMED)
            parts = " and ".join(f"{length:.1f} m of it {what}" for what, length in broken)
            jump = " by a jump" if leg.jump else ""
            yield at(leg.index, leg=leg, jump=jump, parts=parts)


@checks("fence-circle")
def _(context: ValidationContext) -> Hits:
    for fence in context.fences:
        for k in np.flatnonzero(fence.circles.leave).tolist():
            yield at(int(fence.circles.index[k]), where=_broken(fence, fence.circles.shapes[k]))


@checks("fence-flight")
def _(context: ValidationContext) -> Hits:
    for fence in context.fences:
        told = [each.index[each.leave] for each in (fence.legs, fence.circles)]
        leave = fence.flight.leave & ~np.isin(fence.flight.index, np.concatenate(told))
        for index, first in _firsts(leave, fence.flight.index):
            time = context.track.t[first] if context.track is not None else 0.0
            yield at(index, where=_broken(fence, fence.flight.shapes[first]), time=time)


def _firsts(marked: Any, index: Any) -> Iterator[tuple[int, int]]:
    """Yield each item at `index` (n,) of which a sample is `marked` (n,), and the first sample."""
    samples = np.flatnonzero(marked)
    items, first = np.unique(index[samples], return_index=True)
    return zip(items.tolist(), samples[first].tolist(), strict=True)


def _nearest(context: ValidationContext) -> list[tuple[int, float]]:
    """Return the item at which the mission comes nearest to the fence, and how near, m."""
    return [fence.nearest for fence in context.fences if fence.nearest is not None]


@checks("fence-close")
def _(context: ValidationContext) -> Hits:
    return (at(k, margin=margin) for k, margin in _nearest(context) if margin < LEAST_MARGIN)


@checks("fence-margin")
def _(context: ValidationContext) -> Hits:
    return (at(k, margin=margin) for k, margin in _nearest(context) if margin >= LEAST_MARGIN)


@checks("ardupilot-fence-margin")
def _(context: ValidationContext) -> Hits:
    keep, name = context.parameter("fence_margin")
    near = ((k, margin) for k, margin in _nearest(context) if margin < keep)
    return (at(k, margin=margin, keep=keep, name=name) for k, margin in near)


@checks("fence-not-kept")
def _(context: ValidationContext) -> Hits:
    response = context.vehicle.type.at_fence(context.vehicle)
    if context.fences and response.parameter and not response.keeps:
        value, name = context.parameter(response.parameter)
        does = "says so, and flies on" if response.action == "report" else "flies on"
        parameter = name.partition(",")[0]
        yield at(does=does, name=name, value=value, parameter=parameter, to=response.set_to)


@checks("fence-ahead")
def _(context: ValidationContext) -> Hits:
    vehicle, track, positions = context.vehicle, context.track, context.track_positions
    if track is None or positions is None or not vehicle.type.at_fence(vehicle).keeps:
        return
    velocity, speed = track.velocity[:, :2], lengths(track.velocity[:, :2])
    ahead = vehicle.type.fence_ahead(vehicle, speed)
    for fence in context.fences if ahead.any() else ():
        import shapely

        heading = velocity / np.maximum(speed, _STILL)[:, None]
        tested = shapely.points(positions[:, :2] + heading * ahead[:, None])
        outside = fence.leave(np.asarray(tested)) & (speed > _STILL)
        for index, k in _firsts(outside, track.item):
            yield at(index, time=track.t[k], speed=speed[k], ahead=ahead[k])
