"""The fence: what of the mission leaves it, how near it comes, whether the vehicle keeps it."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from faao_mav.mission.fence_area import Area
from faao_mav.validate.context import ValidationContext, number
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME
from faao_mav.vector import lengths

RULES = Rules()
_ARDUPILOT = Rules("ardupilot")

LEAST_MARGIN = 2.0
"""The distance to the fence, m, below which the error of the aircraft's position counts. Chosen;
what a change costs is not measured."""

_STILL = 0.1
"""The speed, m/s, below which an aircraft heads nowhere. Chosen."""

_GEOMETRY = "plane geometry about home; ArduPilot AC_Fence, PX4 Geofence"


def _what(part: Area | None) -> str:
    if part is None:
        return "outside all inclusions"
    return f"{'outside' if part.inclusion else 'inside'} {part.name}"


@RULES.error("fence-crosses-itself", _GEOMETRY)
def _crosses(context: ValidationContext) -> Iterator[Issue]:
    """A fence polygon crosses itself."""
    for area in context.fence.areas if context.fence else ():
        if area.crosses_itself:
            yield Issue(
                None,
                f"{area.name} crosses or touches itself: what counts as inside is not what you see",
                "put its corners in order around the area",
            )


@RULES.error("fence-home", _GEOMETRY)
def _home(context: ValidationContext) -> Iterator[Issue]:
    """Home lies outside the fence."""
    if context.home is not None:
        for issue in _points(context, [("home", (0.0, 0.0))], "move home or the fence"):
            then = context.vehicle.type.home_outside_fence
            yield replace(issue, says="; ".join(filter(None, (issue.says, then))))


@RULES.error("fence-rally", _GEOMETRY)
def _rally(context: ValidationContext) -> Iterator[Issue]:
    """A rally point lies outside the fence."""
    if context.fence is not None:
        points = [
            (f"rally point {n}", context.fence.frame.to_local(point.latitude, point.longitude))
            for n, point in enumerate(context.mission.rally, start=1)
        ]
        yield from _points(context, points, "move the rally point or the fence")


@RULES.error("fence-return", _GEOMETRY)
def _return(context: ValidationContext) -> Iterator[Issue]:
    """The breach return point lies outside the fence."""
    point = context.mission.fence.breach_return
    if context.fence is not None and point is not None:
        local = context.fence.frame.to_local(point.latitude, point.longitude)
        yield from _points(context, [("the breach return point", local)], "move it inside")


def _points(
    context: ValidationContext, points: list[tuple[str, Any]], action: str
) -> Iterator[Issue]:
    if context.fence is None or not points:
        return
    import shapely

    broken = context.fence.broken(shapely.points([place for _, place in points]))
    for k in np.flatnonzero(broken.any).tolist():
        yield Issue(None, f"{points[k][0]} is {' and '.join(map(_what, broken.parts(k)))}", action)


@RULES.error("fence-leg", _GEOMETRY)
def _legs(context: ValidationContext) -> Iterator[Issue]:
    """A leg leaves the fence."""
    fence = context.fence
    if fence is None or not context.legs:
        return
    import shapely

    for k in np.flatnonzero(fence.broken_legs.any).tolist():
        leg = context.legs[k]
        start = "home" if leg.start.index == HOME else f"item {number(leg.start.index)}"
        parts = []
        for part in fence.broken_legs.parts(k):
            shape = fence.free if part is None else part.shape
            inside = shapely.intersection(shape, fence.legs[k]).length
            length = inside if part is not None and not part.inclusion else leg.length - inside
            parts.append(f"{max(length, 0.0):.1f} m of it {_what(part)}")
        jump = " by a jump" if leg.jump else ""
        yield Issue(
            leg.index,
            f"the leg from {start}{jump} is {leg.length:.0f} m long, {' and '.join(parts)}",
            "go around with another waypoint, or change the fence",
        )


@RULES.error("fence-circle", _GEOMETRY)
def _circles(context: ValidationContext) -> Iterator[Issue]:
    """A circle that an item is flown in leaves the fence."""
    fence = context.fence
    if fence is None or not fence.circles:
        return
    for k in np.flatnonzero(fence.broken_rings.any).tolist():
        index = list(fence.circles)[k]
        parts = " and ".join(map(_what, fence.broken_rings.parts(k)))
        yield Issue(
            index,
            f"the circle that is flown there is partly {parts}",
            "give a smaller radius or another centre, or change the fence",
        )


@RULES.warning("fence-flight", f"{_GEOMETRY}; predicted flight")
def _flight(context: ValidationContext) -> Iterator[Issue]:
    """The predicted flight leaves the fence."""
    fence, track = context.fence, context.track
    if fence is None or track is None or not len(fence.flight):
        return
    told = set()
    if context.legs:
        told = {context.legs[k].index for k in np.flatnonzero(fence.broken_legs.any)}
        told |= {list(fence.circles)[k] for k in np.flatnonzero(fence.broken_rings.any)}
    broken = fence.broken_flight
    for index in sorted(set(fence.flight_items[broken.any].tolist()) - told):
        first = int(np.flatnonzero(broken.any & (fence.flight_items == index))[0])
        yield Issue(
            index,
            f"the predicted flight gets {' and '.join(map(_what, broken.parts(first)))}, first at "
            f"{track.t[first]:.0f} s",
            "fly slower there or keep more room, or change the fence",
        )


@RULES.warning("fence-close", _GEOMETRY, summary=f"less than {LEAST_MARGIN:g} m from the fence")
def _close(context: ValidationContext) -> Iterator[Issue]:
    nearest = context.fence.nearest if context.fence else None
    if nearest is not None and nearest[0] < LEAST_MARGIN:
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence; less than {LEAST_MARGIN:g} m is "
            "within the error of the aircraft's position",
            "keep more room",
        )


@RULES.note("fence-margin", _GEOMETRY)
def _margin(context: ValidationContext) -> Iterator[Issue]:
    """How near the mission comes to the fence."""
    nearest = context.fence.nearest if context.fence else None
    if nearest is not None and nearest[0] >= LEAST_MARGIN:
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence, the nearest that the mission comes",
            "",
        )


@RULES.note(
    "fence-not-kept", "FENCE_ENABLE, FENCE_TYPE, FENCE_ACTION (ArduPilot 4.7); GF_ACTION (PX4 1.16)"
)
def _not_kept(context: ValidationContext) -> Iterator[Issue]:
    """The vehicle's parameters let it fly on where it leaves the fence."""
    response = context.vehicle.type.at_fence(context.vehicle)
    if context.fence is None or response.keeps or not response.parameter:
        return
    value = context.vehicle.value(response.parameter)
    name = context.vehicle.name_of(response.parameter)
    does = "says so, and flies on" if response.action == "report" else "flies on"
    yield Issue(
        None,
        f"a vehicle that leaves the fence {does} ({name} {value:g})",
        f"set {name.partition(',')[0]} to {response.set_to} for the vehicle to turn back",
    )


@_ARDUPILOT.note(
    "ardupilot-fence-margin",
    "measured on ArduCopter 4.7: in AUTO it flies on, at 1 m with FENCE_MARGIN 2 too",
)
def _fence_margin(context: ValidationContext) -> Iterator[Issue]:
    """The mission comes nearer to the fence than FENCE_MARGIN."""
    nearest = context.fence.nearest if context.fence else None
    margin = context.vehicle.value("fence_margin")
    if nearest is not None and nearest[0] < margin:
        name = context.vehicle.name_of("fence_margin")
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence; {name} is {margin:g} m: in AUTO "
            "ArduPilot flies there all the same, in modes that avoid the fence it does not",
            "keep more room, or set FENCE_MARGIN to less",
        )


@RULES.warning(
    "fence-ahead",
    "GF_PREDICT: PX4 1.16 GeofenceBreachAvoidance; measured: at 7 m/s it stopped 32 m before",
)
def _ahead(context: ValidationContext) -> Iterator[Issue]:
    """The vehicle takes a flight towards the fence for one that leaves it."""
    vehicle, fence, track = context.vehicle, context.fence, context.track
    if fence is None or track is None or context.track_positions is None:
        return
    velocity, positions = track.velocity[:, :2], context.track_positions[:, :2]
    speed = lengths(velocity)
    ahead = vehicle.type.fence_ahead(vehicle, speed)
    if not ahead.any() or not vehicle.type.at_fence(vehicle).keeps:
        return
    import shapely

    moving = speed > _STILL
    tested = positions[moving] + velocity[moving] * (ahead[moving] / speed[moving])[:, None]
    outside = np.zeros(len(speed), dtype=bool)
    outside[moving] = fence.broken(shapely.points(tested)).any
    for index in np.unique(track.item[outside]).tolist():
        first = int(np.flatnonzero(outside & (track.item == index))[0])
        yield Issue(
            index,
            f"at {track.t[first]:.0f} s the flight is at {speed[first]:.1f} m/s, and "
            f"{ahead[first]:.0f} m straight on it were outside the fence: the vehicle "
            "breaks off the mission there",
            "set GF_PREDICT to 0, or fly slower there and keep more room",
        )


RULES += _ARDUPILOT
