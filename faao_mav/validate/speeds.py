"""Whether the speeds that are asked for, and the path's corners and climbs, can be flown."""

import math
from collections.abc import Iterator
from itertools import groupby, pairwise
from typing import TYPE_CHECKING

import numpy as np

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.body import CopterBody
from faao_mav.autopilot.vehicle_type import OVERSPEED, lean_acceleration
from faao_mav.errors import counted
from faao_mav.mission.command import Command
from faao_mav.power import GRAVITY
from faao_mav.validate.context import HOME, Straight, ValidationContext
from faao_mav.validate.rule import Hits, checks, hit, threshold
from faao_mav.vector import lengths

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Solution


@checks
def _asked(context: ValidationContext) -> Hits:
    """What DO_CHANGE_SPEED asks for."""
    default, default_name = context.parameter("cruise_speed")
    limit, limit_name = context.parameter("max_speed")
    least, hovers = context.value("min_speed"), context.vehicle.type.hovers
    for k, item in context.each(Command.DO_CHANGE_SPEED):
        kind, speed, throttle, _ = item.params
        if context.changes[k] is None and (hovers or not throttle > 0):
            yield hit("ardupilot-speed-ignored", k)
        if not speed > 0:
            yield hit("px4-speed-default", k, default=default, name=default_name)
            continue
        if kind in (2, 3):
            yield hit("px4-speed-type", k)
        if speed > limit:
            yield hit("px4-speed-capped", k, limit=limit, name=limit_name)
        if speed < least or speed > limit:
            yield hit("px4-plane-speed", k, least=least, top=limit)
            if kind == 0:
                yield hit("ardupilot-plane-speed", k, least=least, top=limit)


@checks
def _lean(context: ValidationContext) -> Hits:
    top = context.vehicle.top_airspeed
    changes = ((change, -k) for k, change in enumerate(context.changes) if change is not None)
    level = ((change.speed or 0.0, k) for change, k in changes if change.axis == "horizontal")
    fastest, k = max(level, default=(0.0, 0))
    if fastest > top:
        angle, name = context.parameter("lean_angle")
        yield hit("speed-lean", -k, speed=fastest, top=top, angle=math.degrees(angle), name=name)


def beyond_lean(solution: "Solution", vehicle: Vehicle) -> str | None:
    """Return in words how `solution` asks `vehicle` to lean further than it may; None: not at all.

    At the velocity v through the air and the acceleration a it leans by

        tan(lean) = |a + (c_1 + c_2 |v|) v| / g,

    with the drag of its body. Without a model with drag nothing is known to lack.
    """
    body = vehicle.airframe
    if not isinstance(body, CopterBody) or not vehicle.type.models_wind:
        return None
    v = solution.v - solution.plan.wind
    drag = (body.linear_drag + body.quadratic_drag * lengths(v)[:, None]) * v
    push = np.maximum(*(lengths(solution.a[:-1] + each) for each in (drag[:-1], drag[1:])))
    allowed, slot = vehicle.value("lean_angle"), float(solution.t[1])
    missing = np.maximum(push - lean_acceleration(allowed), 0.0)
    if slot * missing.sum() < threshold.missing:
        return None
    return (
        f"the plan asks for a lean of up to {math.degrees(math.atan(push.max() / GRAVITY)):.0f} "
        f"degrees against the drag of vehicle.body, and for {slot * (missing > 0).sum():.1f} s of "
        f"more than the {math.degrees(allowed):.0f} that its parameters allow: it falls behind"
    )


@checks
def _slow(context: ValidationContext) -> Hits:
    """Runs of neighbouring legs that stay below their commanded speed."""
    pairs = _reached_speeds(context)
    for slow, run in groupby(pairs, lambda pair: 100 * pair[1] < threshold.reached * pair[0].speed):
        if not slow:
            continue
        legs, reached = zip(*run, strict=True)
        mean, commanded = float(np.mean(reached)), float(np.mean([leg.speed for leg in legs]))
        told = {"asked": max(leg.speed for leg in legs)}
        lost = sum(
            leg.length * (1 / max(v, threshold.slowest) - 1 / leg.speed)
            for leg, v in zip(legs, reached, strict=True)
        )
        if len(legs) >= threshold.crawl_legs and 100 * mean < threshold.crawl * commanded:
            spacing = float(np.mean([leg.length for leg in legs]))
            told |= {"count": len(legs), "last": legs[-1].index + 1, "spacing": spacing}
            yield hit("crawl", legs[0].index, mean=mean, **told)
        # A plan may ask for a speed that only the next leg reaches: link-timing judges that.
        elif lost >= threshold.time_lost and context.link is None:
            where = f"on this leg of {legs[0].length:.0f} m"
            if len(legs) > 1:
                where = f"on the {len(legs)} legs from here to item {legs[-1].index + 1}"
            span = " to ".join(dict.fromkeys(f"{each(reached):.1f}" for each in (min, max)))
            yield hit("speed-not-reached", legs[0].index, where=where, span=span, **told)


def _reached_speeds(context: ValidationContext) -> Iterator[tuple[Straight, float]]:
    """Yield a copter's legs between waypoints, and its greatest predicted speed on each, m/s."""
    if context.track is None or not context.vehicle.type.hovers:
        return
    waypoints = {k for k, _ in context.each(Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)}
    fastest = np.full(len(context.items), -np.inf)
    np.maximum.at(fastest, context.track.item, np.hypot(*context.track.velocity[:, :2].T))
    for leg in _long_legs(context):
        between = leg.index in waypoints and leg.start.index != HOME and not leg.jump
        if between and fastest[leg.index] >= 0:
            yield leg, float(fastest[leg.index])


def _long_legs(context: ValidationContext) -> Iterator[Straight]:
    return (leg for leg in context.legs if leg.length >= threshold.shortest)


@checks
def _limits(context: ValidationContext) -> Hits:
    """Speeds and accelerations beside those of the plan's vehicle."""
    before, most, above = None, context.limits.max_speed or math.inf, []
    for leg in _long_legs(context):
        if most < leg.speed <= OVERSPEED * most:
            above.append(leg)
        elif leg.speed > most and leg.speed != before:
            yield hit("speed-above-limit", leg.index, leg=leg)
        before = leg.speed
    if above:
        fastest = max(above, key=lambda leg: leg.speed)
        yield hit("speed-headroom", fastest.index, leg=fastest)
    limit, track = context.limits.max_acceleration, context.track
    if limit is None or track is None or len(track.t) < 3:
        return
    acceleration = np.hypot(*np.gradient(track.velocity[:, :2], track.t, axis=0).T)
    worst = int(np.argmax(acceleration))
    if acceleration[worst] > 1.05 * limit:
        told = {"acceleration": acceleration[worst], "time": track.t[worst]}
        yield hit("acceleration-above-limit", int(track.item[worst]), **told)


def _corners(context: ValidationContext) -> Iterator[tuple[Straight, Straight, float]]:
    """Yield the legs before and after each plain waypoint that is passed, and the turn, rad."""
    # A return to launch starts from a stop.
    legs = (leg for leg in _long_legs(context) if not leg.jump and leg.end.index != HOME)
    for before, after in pairwise(legs):
        item = context.items[before.index]
        passed = item.command == Command.NAV_WAYPOINT and not item.params[0] > 0
        if passed and after.start == before.end and not after.spline:
            yield before, after, before.turn(after)


@checks
def _turns(context: ValidationContext) -> Hits:
    """Corners for which a copter slows down, and those that a plane cannot fly."""
    bank, sharp = context.value("roll_limit"), []
    for before, after, turn in _corners(context):
        if before.speed > threshold.slow and math.degrees(turn) > threshold.sharp:
            sharp.append((turn, -before.index, before))
        radius = before.speed * before.speed / (GRAVITY * math.tan(bank))
        needed = radius * math.tan(min(turn, math.radians(threshold.reversal)) / 2)
        room = min(before.length, after.length)
        if needed > room:
            told = {"turn": math.degrees(turn), "bank": math.degrees(bank), "needed": needed}
            yield hit("turn-too-tight", before.index, leg=before, room=room, **told)
    if sharp and context.vehicle.type.hovers:
        turn, _, leg = max(sharp)
        count, turn = counted(len(sharp), "corner"), math.degrees(turn)
        yield hit("sharp-corners", leg.index, count=count, turn=turn, leg=leg)


@checks
def _steep(context: ValidationContext) -> Hits:
    climb, descent = (context.vehicle.value(each) for each in ("climb_speed", "descent_speed"))
    waypoints = {k for k, _ in context.each(Command.NAV_WAYPOINT)}
    for leg in _long_legs(context):
        way, limit = ("climbs", climb) if leg.rise > 0 else ("descends", descent)
        level, vertical = leg.length / leg.speed, abs(leg.rise) / limit
        steep = math.isfinite(vertical) and level < threshold.climb_share * vertical
        if steep and leg.index in waypoints and leg.start.index != HOME:
            told = {"rise": abs(leg.rise), "limit": limit, "vertical": vertical, "level": level}
            yield hit(
                "steep-leg", leg.index, leg=leg, way=way, slower=leg.length / vertical, **told
            )
