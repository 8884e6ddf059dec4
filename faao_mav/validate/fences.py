"""The fence: what of the mission leaves it, how near it comes, whether the vehicle keeps it."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from faao_mav.validate.context import ValidationContext
from faao_mav.validate.fence_map import FenceMap, Shapes, lines
from faao_mav.validate.rule import Checks, Hits, hit
from faao_mav.vector import lengths

checks = Checks()

LEAST_MARGIN = 2.0
"""The distance to the fence, m, below which the error of the aircraft's position counts. Chosen;
what a change costs is not measured."""

_STILL = 0.1
"""The speed, m/s, below which an aircraft heads nowhere. Chosen."""


@checks()
def _points(context: ValidationContext) -> Hits:
    """The fence itself, and the points beside the items that lie outside."""
    back, then = context.mission.fence.breach_return, context.vehicle.type.home_outside_fence
    for fence in context.fences:
        for area in fence.areas:
            if area.crosses_itself:
                yield hit("fence-crosses-itself", name=area.name)
        if context.home is not None and (where := _broken(fence, (0.0, 0.0))):
            yield hit("fence-home", where=where, then=f"; {then}" if then else "")
        for n, point in enumerate(context.mission.rally, start=1):
            if where := _broken(fence, fence.frame.to_local(point.latitude, point.longitude)):
                yield hit("fence-rally", n=n, where=where)
        for point in (back,) if back is not None else ():
            if where := _broken(fence, fence.frame.to_local(point.latitude, point.longitude)):
                yield hit("fence-return", where=where)


def _broken(fence: FenceMap, shape: Any) -> str:
    """Return in words which parts of the fence `shape`, or a place (2,), m, breaks, "" if none."""
    import shapely

    shape = shape if isinstance(shape, shapely.Geometry) else shapely.Point(shape)
    return " and ".join(broken for broken, _ in fence.broken_by(shape))


@checks()
def _ways(context: ValidationContext) -> Hits:
    """Legs, circles and the predicted flight, of which no item is told twice, and the margin."""
    for fence in context.fences:
        legs, circles, flight = _shapes(context)
        heading = context.track.item[1:] if context.track is not None else np.empty(0, dtype=int)
        told = set()
        for k in np.flatnonzero(fence.leave(legs)).tolist():
            leg, broken = context.legs[k], fence.broken_by(legs[k])
            parts = " and ".join(f"{length:.1f} m of it {what}" for what, length in broken)
            jump = " by a jump" if leg.jump else ""
            told.add(leg.index)
            yield hit("fence-leg", leg.index, leg=leg, jump=jump, parts=parts)
        for k in np.flatnonzero(fence.leave(circles)).tolist():
            index = [*context.circles][k]
            told.add(index)
            yield hit("fence-circle", index, where=_broken(fence, circles[k]))
        outside = fence.leave(flight)
        for index, k in _firsts(outside, heading):
            if index not in told and context.track is not None:
                where = _broken(fence, flight[k])
                yield hit("fence-flight", index, where=where, time=context.track.t[k])
        nearest = None
        if len(legs) and not told and not outside.any():
            nearest = fence.nearest(np.concatenate([legs, circles, flight]))
        if nearest is not None:
            k, margin = nearest
            index = [*(leg.index for leg in context.legs), *context.circles, *heading.tolist()][k]
            rule = "fence-close" if margin < LEAST_MARGIN else "fence-margin"
            yield hit(rule, index, margin=margin)
            if "fence_margin" in context.vehicle.type.parameters:
                keep, name = context.parameter("fence_margin")
                if margin < keep:
                    yield hit("ardupilot-fence-margin", index, margin=margin, keep=keep, name=name)


def _shapes(context: ValidationContext) -> list[Shapes]:
    """Return legs, circles, and the predicted flight from sample to sample."""
    legs = np.array([[leg.start.ground, leg.end.ground] for leg in context.legs])
    circles, flown = np.array([*context.circles.values()]), np.empty((1, 2))
    if context.track_positions is not None:
        flown = context.track_positions[:, :2]
    steps = np.stack([flown[:-1], flown[1:]], axis=1)
    return [lines(each if len(each) else steps[:0]) for each in (legs, circles, steps)]


@checks()
def _kept(context: ValidationContext) -> Hits:
    """What the vehicle does at its fence, and where it looks ahead for it."""
    vehicle, track, positions = context.vehicle, context.track, context.track_positions
    response = vehicle.type.at_fence(vehicle)
    if context.fences and response.parameter and not response.keeps:
        value, name = context.parameter(response.parameter)
        does = "says so, and flies on" if response.action == "report" else "flies on"
        to, parameter = response.set_to, name.partition(",")[0]
        yield hit("fence-not-kept", does=does, name=name, value=value, parameter=parameter, to=to)
    if track is None or positions is None or not response.keeps:
        return
    velocity, speed = track.velocity[:, :2], lengths(track.velocity[:, :2])
    ahead = vehicle.type.fence_ahead(vehicle, speed)
    for fence in context.fences if ahead.any() else ():
        import shapely

        heading = velocity / np.maximum(speed, _STILL)[:, None]
        tested = shapely.points(positions[:, :2] + heading * ahead[:, None])
        outside = fence.leave(np.asarray(tested)) & (speed > _STILL)
        for index, k in _firsts(outside, track.item):
            yield hit("fence-ahead", index, time=track.t[k], speed=speed[k], ahead=ahead[k])


def _firsts(marked: Any, index: Any) -> Iterator[tuple[int, int]]:
    """Yield each item at `index` (n,) of which a sample is `marked` (n,), and the first sample."""
    samples = np.flatnonzero(marked)
    items, first = np.unique(index[samples], return_index=True)
    return zip(items.tolist(), samples[first].tolist(), strict=True)
