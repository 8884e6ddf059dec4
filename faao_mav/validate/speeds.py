"""Whether the speeds that are asked for, and the path's corners and climbs, can be flown."""

import math
from collections.abc import Iterator
from itertools import groupby, pairwise

import numpy as np

from faao_mav.autopilot.vehicle_type import OVERSPEED
from faao_mav.mission.command import Command
from faao_mav.power import GRAVITY
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Checks, Hits, at
from faao_mav.validate.straight import HOME, Straight

checks = Checks()

REACHED_PERCENT = 80.0
"""The share of the commanded speed, %, below which a leg is reported. Chosen."""

TIME_LOST = 2.0
"""The least time, s, that a reported run of slow legs loses: in less, corners are taken and speeds
are changed. Chosen."""

CRAWL_PERCENT = 50.0
"""The share of the commanded speed, %, below which a row of legs is a crawl. Chosen."""

CRAWL_LEGS = 5
"""The least number of legs in a row that make a crawl. Chosen."""

SPARE_PERCENT = 100 * (OVERSPEED - 1)
"""By how much, %, a mission may command more than the plan's max_speed."""

_SHORTEST = 1.0
"""The length, m, below which a leg is a correction: it has no direction, and nobody speeds up on
it. Chosen."""

_SLOWEST = 0.1
"""The least speed that is reckoned with, m/s, so that times stay finite."""

SHARP = 45.0
"""The turn, degrees, above which a copter slows down for a corner. Measured on ArduCopter and
PX4."""

_SLOW = 3.0
"""The commanded speed, m/s, up to which corners hardly matter. Chosen."""

_CLIMB_SHARE = 0.8
"""The share of the climbing time that the way over ground may fall short to: less, and the leg is
steep. Chosen."""


def _asked(context: ValidationContext) -> Iterator[tuple[int, float, float]]:
    """Return index, type and speed, m/s, of each DO_CHANGE_SPEED."""
    return ((k, *item.params[:2]) for k, item in context.each(Command.DO_CHANGE_SPEED))


@checks("speed-lean")
def _(context: ValidationContext) -> Hits:
    top = context.vehicle.top_airspeed
    changes = ((change, -k) for k, change in enumerate(context.changes) if change is not None)
    level = ((change.speed or 0.0, k) for change, k in changes if change.axis == "horizontal")
    fastest, k = max(level, default=(0.0, 0))
    if fastest > top:
        angle, name = context.parameter("lean_angle")
        yield at(-k, speed=fastest, top=top, angle=math.degrees(angle), name=name)


@checks("ardupilot-speed-ignored")
def _(context: ValidationContext) -> Hits:
    own = context.vehicle.type
    for index, item in context.each(Command.DO_CHANGE_SPEED):
        throttle = 0.0 if own.hovers else item.params[2]
        if own.dialect.speed_change(item) is None and not throttle > 0:
            yield at(index)


@checks("ardupilot-plane-speed")
def _(context: ValidationContext) -> Hits:
    return _airspeeds(context, (0,))


@checks("px4-plane-speed")
def _(context: ValidationContext) -> Hits:
    return _airspeeds(context, ())


def _airspeeds(context: ValidationContext, kinds: tuple[float, ...]) -> Hits:
    """Yield the airspeeds outside those that a plane flies, asked for by one of `kinds`, or any."""
    least, top = context.vehicle.value("min_speed"), context.vehicle.value("max_speed")
    for index, kind, speed in _asked(context):
        if (kind in kinds or not kinds) and speed > 0 and not least <= speed <= top:
            yield at(index, least=least, top=top)


@checks("px4-speed-default")
def _(context: ValidationContext) -> Hits:
    default, name = context.parameter("cruise_speed")
    asked = (k for k, _, speed in _asked(context) if not speed > 0)
    return (at(k, default=default, name=name) for k in asked)


@checks("px4-speed-type")
def _(context: ValidationContext) -> Hits:
    return (at(k) for k, kind, speed in _asked(context) if kind in (2, 3) and speed > 0)


@checks("px4-speed-capped")
def _(context: ValidationContext) -> Hits:
    limit, name = context.parameter("max_speed")
    asked = (k for k, _, speed in _asked(context) if speed > limit)
    return (at(k, limit=limit, name=name) for k in asked)


@checks("speed-not-reached")
def _(context: ValidationContext) -> Hits:
    # A plan may ask for a speed that only the next leg reaches: link-timing judges that.
    for legs, reached in _slow_runs(context) if context.link is None else ():
        times = (
            leg.length * (1 / max(v, _SLOWEST) - 1 / leg.speed)
            for leg, v in zip(legs, reached, strict=True)
        )
        if sum(times) >= TIME_LOST and not _crawls(legs, reached):
            where = f"on this leg of {legs[0].length:.0f} m"
            if len(legs) > 1:
                where = f"on the {len(legs)} legs from here to item {legs[-1].index + 1}"
            span = " to ".join(dict.fromkeys(f"{each(reached):.1f}" for each in (min, max)))
            yield at(legs[0].index, where=where, span=span, asked=max(leg.speed for leg in legs))


@checks("crawl")
def _(context: ValidationContext) -> Hits:
    for legs, reached in _slow_runs(context):
        if _crawls(legs, reached):
            spacing, mean = (float(np.mean(x)) for x in ([leg.length for leg in legs], reached))
            told = {"count": len(legs), "last": legs[-1].index + 1, "spacing": spacing}
            yield at(legs[0].index, **told, mean=mean, asked=max(leg.speed for leg in legs))


def _crawls(legs: list[Straight], reached: list[float]) -> bool:
    """Tell whether a run of legs is long and slow enough to be called a crawl."""
    commanded = sum(leg.speed for leg in legs)
    return len(legs) >= CRAWL_LEGS and 100 * sum(reached) < CRAWL_PERCENT * commanded


def _slow_runs(context: ValidationContext) -> Iterator[tuple[list[Straight], list[float]]]:
    """Yield neighbouring legs that stay below their commanded speed, and what they reach, m/s."""
    pairs = _reached_speeds(context)
    for slow, run in groupby(pairs, lambda pair: 100 * pair[1] < REACHED_PERCENT * pair[0].speed):
        if slow:
            legs, reached = zip(*run, strict=True)
            yield list(legs), list(reached)


def _reached_speeds(context: ValidationContext) -> list[tuple[Straight, float]]:
    """Return the level legs between waypoints, and the speed that each reaches, m/s.

    That is the greatest speed of the predicted flight towards the leg's end. Without one it is
    what the leg's length allows by the model of a single leg, of which splines have none.
    """
    waypoints = {k for k, _ in context.each(Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)}
    legs = [leg for leg in _long_legs(context) if leg.index in waypoints]
    legs = [leg for leg in legs if leg.start.index != HOME and not leg.jump]
    if context.track is None:
        legs = [leg for leg in legs if not leg.spline]
        reachable = context.vehicle.legs.reachable_speed(np.array([leg.length for leg in legs]))
        return [(leg, min(float(v), leg.speed)) for leg, v in zip(legs, reachable, strict=True)]
    fastest = np.full(len(context.items), -np.inf)
    np.maximum.at(fastest, context.track.item, np.hypot(*context.track.velocity[:, :2].T))
    flown = (leg for leg in legs if fastest[leg.index] >= 0)
    return [(leg, float(fastest[leg.index])) for leg in flown]


def _long_legs(context: ValidationContext) -> Iterator[Straight]:
    return (leg for leg in context.legs if leg.length >= _SHORTEST)


@checks("speed-above-limit")
def _(context: ValidationContext) -> Hits:
    return (at(k, speed=v, limit=limit) for k, v, limit in _faster_than(context, OVERSPEED))


@checks("speed-headroom")
def _(context: ValidationContext) -> Hits:
    above = ((v, -k, limit) for k, v, limit in _faster_than(context, 1.0) if v <= OVERSPEED * limit)
    for speed, index, limit in sorted(above)[-1:]:
        yield at(-index, speed=speed, limit=limit)


def _faster_than(context: ValidationContext, share: float) -> Iterator[tuple[int, float, float]]:
    """Yield where a speed above `share` of the limit begins: the leg's index, speed, limit, m/s."""
    before, limit = None, context.limits.max_speed or math.inf
    for leg in _long_legs(context):
        if leg.speed > share * limit and leg.speed != before:
            yield leg.index, leg.speed, limit
        before = leg.speed


@checks("acceleration-above-limit")
def _(context: ValidationContext) -> Hits:
    limit, track = context.limits.max_acceleration, context.track
    if limit is None or track is None or len(track.t) < 3:
        return
    acceleration = np.hypot(*np.gradient(track.velocity[:, :2], track.t, axis=0).T)
    worst = int(np.argmax(acceleration))
    if acceleration[worst] > 1.05 * limit:
        told = {"acceleration": acceleration[worst], "time": track.t[worst], "limit": limit}
        yield at(int(track.item[worst]), **told)


def _corners(context: ValidationContext) -> Iterator[tuple[Straight, Straight, float]]:
    """Yield the legs before and after each plain waypoint that is passed, and the turn, rad."""
    # A return to launch starts from a stop.
    legs = (leg for leg in _long_legs(context) if not leg.jump and leg.end.index != HOME)
    for before, after in pairwise(legs):
        item = context.items[before.index]
        passed = item.command == Command.NAV_WAYPOINT and not item.params[0] > 0
        if passed and after.start == before.end and not after.spline:
            yield before, after, before.turn(after)


@checks("sharp-corners")
def _(context: ValidationContext) -> Hits:
    at_speed = [
        (math.degrees(turn), leg) for leg, _, turn in _corners(context) if leg.speed > _SLOW
    ]
    sharp = [(turn, leg) for turn, leg in at_speed if turn > SHARP]
    if sharp:
        turn, leg = max(sharp, key=lambda corner: corner[0])
        slow, passing = "", context.vehicle.type.corner_speed
        if passing is not None:
            slow = f", passed at about {passing(context.vehicle, math.radians(turn)):.1f} m/s"
        count = "1 corner" if len(sharp) == 1 else f"{len(sharp)} corners"
        yield at(leg.index, count=count, turn=turn, speed=leg.speed, slow=slow)


@checks("turn-too-tight")
def _(context: ValidationContext) -> Hits:
    bank = context.vehicle.value("roll_limit")
    for before, after, turn in _corners(context):
        radius = before.speed * before.speed / (GRAVITY * math.tan(bank))
        needed = radius * math.tan(min(turn, math.radians(179)) / 2)
        room = min(before.length, after.length)
        if needed > room:
            told = {"turn": math.degrees(turn), "bank": math.degrees(bank)}
            yield at(before.index, leg=before, **told, needed=needed, room=room)


@checks("steep-leg")
def _(context: ValidationContext) -> Hits:
    climb, descent = (context.vehicle.value(each) for each in ("climb_speed", "descent_speed"))
    waypoints = {k for k, _ in context.each(Command.NAV_WAYPOINT)}
    for leg in _long_legs(context):
        way, limit = ("climbs", climb) if leg.rise > 0 else ("descends", descent)
        level, vertical = leg.length / leg.speed, abs(leg.rise) / limit
        steep = math.isfinite(vertical) and level < _CLIMB_SHARE * vertical
        if steep and leg.index in waypoints and leg.start.index != HOME:
            told = {"rise": abs(leg.rise), "limit": limit, "vertical": vertical, "level": level}
            yield at(leg.index, leg=leg, way=way, slower=leg.length / vertical, **told)
