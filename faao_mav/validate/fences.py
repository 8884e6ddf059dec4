"""The fence: what of the mission leaves it, how near it comes, whether the vehicle keeps it."""

from collections.abc import Iterator
from itertools import islice
from typing import Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from faao_mav.arrays import Flags
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence_area import FreeArea, areas_of, free_area
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Hits, checks, hit, threshold

Shapes: TypeAlias = NDArray[np.object_]
"""Geometries of the local frame."""

_NAMED = 3  # Parts of the fence that a way is told to break, at most. Chosen: more help nobody.


class _Fence:
    """The fence of a mission that has one, in the plane; without a frame about its own place.

    `allowed` is where its `areas` let the aircraft be, their edges included. `any_inclusion`: one
    inclusion is enough, as PX4 and ArduPilot's FENCE_OPTIONS 2 have it; else all have to hold.
    """

    def __init__(self, context: ValidationContext) -> None:
        self.frame = context.frame or LocalFrame(*context.mission.fence.place)
        self.any_inclusion = context.vehicle.type.fence_needs_one_inclusion(context.vehicle)
        self.areas = areas_of(context.mission.fence, self.frame)
        self.allowed = FreeArea.of(self.areas, any_inclusion=self.any_inclusion)

    def leave(self, shapes: Shapes) -> Flags:
        """Return which of `shapes` (n,) leave the fence, (n,)."""
        return np.asarray(~shapely.covers(self.allowed.shape, shapes))

    def broken_by(self, shape: BaseGeometry) -> Iterator[tuple[str, float]]:
        """Yield in words the parts that `shape` breaks, and which length of it does, m."""
        inclusions = [(f"outside {a.name}", a.shape) for a in self.areas if a.inclusion]
        if self.any_inclusion and len(inclusions) > 1:
            free = free_area(self.areas, any_inclusion=True)
            inclusions = [("outside all inclusions", free)] if free is not None else []
        for broken, area in inclusions:
            if not area.covers(shape):
                yield broken, (shape - area).length
        for each in self.areas:
            met = not each.inclusion and each.shape.intersects(shape)
            if met and not each.shape.touches(shape):
                yield f"inside {each.name}", (shape & each.shape).length

    def where(self, shape: Any) -> str:
        """Return in words which parts `shape`, or a place (2,), m, breaks; "" if none."""
        shape = shape if isinstance(shape, shapely.Geometry) else shapely.Point(shape)
        return " and ".join(broken for broken, _ in islice(self.broken_by(shape), _NAMED))

    def nearest(self, shapes: Shapes) -> tuple[int, float] | None:
        """Return which of `shapes` (n,) comes nearest to an edge, and how near, m.

        None where there is no edge: a fence that encloses nothing.
        """
        rings = [shapely.LinearRing(edge) for edge in self.allowed.edges()]
        if not rings:
            return None
        (_, found), margins = shapely.STRtree(shapes).query_nearest(rings, return_distance=True)
        nearest = int(np.argmin(margins))
        return int(found[nearest]), float(margins[nearest])


@checks
def _all(context: ValidationContext) -> Hits:
    if context.mission.fence:
        fence = _Fence(context)
        yield from _points(context, fence)
        yield from _ways(context, fence)
        yield from _kept(context, fence)


def _points(context: ValidationContext, fence: _Fence) -> Hits:
    """Tell of the fence itself, and of points beside the items that lie outside."""
    for area in fence.areas:
        if area.crosses_itself:
            yield hit("fence-crosses-itself", name=area.name)
    then = context.vehicle.type.home_outside_fence
    if context.home is not None and (where := fence.where((0.0, 0.0))):
        yield hit("fence-home", where=where, then=f"; {then}" if then else "")
    back = context.mission.fence.breach_return
    points = [("fence-rally", n, p) for n, p in enumerate(context.mission.rally, start=1)]
    for rule, n, point in [*points, *([("fence-return", 0, back)] if back is not None else [])]:
        if where := fence.where(fence.frame.to_local(point.latitude, point.longitude)):
            yield hit(rule, n=n, where=where)


def _ways(context: ValidationContext, fence: _Fence) -> Hits:
    """Tell of legs, circles and the predicted flight, of no item twice, and of the margin."""
    legs, circles, flight = _shapes(context)
    heading = context.track.item[1:] if context.track is not None else np.empty(0, dtype=int)
    told = set()
    for k in np.flatnonzero(fence.leave(legs)).tolist():
        leg, jump = context.legs[k], " by a jump" if context.legs[k].jump else ""
        parts = islice(fence.broken_by(legs[k]), _NAMED)
        broken = (f"{length:.1f} m of it {what}" for what, length in parts)
        told.add(leg.index)
        yield hit("fence-leg", leg.index, leg=leg, jump=jump, parts=" and ".join(broken))
    for k in np.flatnonzero(fence.leave(circles)).tolist():
        index = [*context.circles][k]
        told.add(index)
        yield hit("fence-circle", index, where=fence.where(circles[k]))
    outside = fence.leave(flight)
    for index, k in _firsts(outside, heading):
        if index not in told and context.track is not None:
            yield hit("fence-flight", index, where=fence.where(flight[k]), time=context.track.t[k])
    if told or outside.any() or not len(legs):
        return
    nearest = fence.nearest(np.concatenate([legs, circles, flight]))
    if nearest is not None:
        k, margin = nearest
        index = [*(leg.index for leg in context.legs), *context.circles, *heading.tolist()][k]
        rule = "fence-close" if margin < threshold.least_margin else "fence-margin"
        yield hit(rule, index, margin=margin)
        keep, name = context.parameter("fence_margin")
        if margin < keep:
            yield hit("ardupilot-fence-margin", index, margin=margin, keep=keep, name=name)


def _shapes(context: ValidationContext) -> list[Shapes]:
    """Return legs, circles, and the predicted flight from sample to sample."""
    legs = np.array([[leg.start.place, leg.end.place] for leg in context.legs])
    circles, flown, shapes = np.array([*context.circles.values()]), context.flown, []
    for ways in (legs, circles, np.stack([flown[:-1], flown[1:]], axis=1)):
        ways = ways if len(ways) else np.empty((0, 2))
        lines = np.asarray(shapely.linestrings(ways.real, ways.imag), dtype=object)
        still = (ways == ways[:, :1]).all(axis=1)
        lines[still] = shapely.points(ways[still, 0].real, ways[still, 0].imag)
        shapes.append(lines)
    return shapes


def _kept(context: ValidationContext, fence: _Fence) -> Hits:
    """Tell what the vehicle does at its fence, and where it looks ahead for it."""
    vehicle, track = context.vehicle, context.track
    response = vehicle.type.at_fence(vehicle)
    if response.parameter and not response.keeps:
        value, name = context.parameter(response.parameter)
        does = "says so, and flies on" if response.action == "report" else "flies on"
        to, parameter = response.set_to, name.partition(",")[0]
        yield hit("fence-not-kept", does=does, name=name, value=value, parameter=parameter, to=to)
    if track is None or not response.keeps:
        return
    velocity = track.velocity[:, :2] @ (1, 1j)
    speed = np.abs(velocity)
    ahead = vehicle.type.fence_ahead(vehicle, speed)
    if ahead.any():
        there = context.flown + velocity / np.maximum(speed, threshold.still) * ahead
        tested = np.asarray(shapely.points(there.real, there.imag))
        for index, k in _firsts(fence.leave(tested) & (speed > threshold.still), track.item):
            yield hit("fence-ahead", index, time=track.t[k], speed=speed[k], ahead=ahead[k])


def _firsts(marked: Any, index: Any) -> Iterator[tuple[int, int]]:
    """Yield each item at `index` (n,) of which a sample is `marked` (n,), and the first sample."""
    samples = np.flatnonzero(marked)
    items, first = np.unique(index[samples], return_index=True)
    return zip(items.tolist(), samples[first].tolist(), strict=True)
