"""Items and their order, and what any autopilot refuses or loses of them."""

import math

from faao_mav.mission.command import (
    ABOVE_HOME,
    ABOVE_SEA,
    FLOWN_TO,
    LANDINGS,
    TAKEOFFS,
    Command,
    Frame,
)
from faao_mav.mission.item import MissionItem
from faao_mav.validate.context import LARGEST, ValidationContext, fits_message
from faao_mav.validate.rule import Checks, Hits, at
from faao_mav.validate.straight import HOME

checks = Checks()

_LANDING_SEQUENCES = (Command.DO_LAND_START, 188)
_ENDINGS = (*LANDINGS, Command.NAV_RETURN_TO_LAUNCH, Command.NAV_LOITER_UNLIM)

_LAND = (-430.0, 8849.0)
"""The lowest and the highest land on Earth, m above sea level: the Dead Sea's shore, Everest."""


@checks("empty")
def _(context: ValidationContext) -> Hits:
    return () if context.items else (at(),)


@checks("no-home")
def _(context: ValidationContext) -> Hits:
    return (at(),) if context.items and context.mission.home is None else ()


@checks("home-height")
def _(context: ValidationContext) -> Hits:
    home = context.mission.home
    if home is not None and not _LAND[0] <= home.altitude <= _LAND[1]:
        told = f"home is {home.altitude:,.0f} m above sea level, where no land is"
        if math.isnan(home.altitude):
            told = "the file has no height of home: heights above sea level are not checked"
        yield at(told=told)


@checks("rally-height")
def _(context: ValidationContext) -> Hits:
    for n, point in enumerate(context.mission.rally, start=1):
        if math.isnan(point.altitude):
            yield at(place=f"rally point {n}", then="`upload` refuses it")
    back = context.mission.fence.breach_return
    if back is not None and math.isnan(back.altitude):
        yield at(place="the return point after a breach", then="the vehicle's parameters set it")


@checks("unreachable")
def _(context: ValidationContext) -> Hits:
    end = next((k for k in range(len(context.items)) if _ends(context, k)), len(context.items))
    rest = [k for k, _ in context.flying if k > end]
    # A landing sequence, or the target of a jump, is there on purpose.
    meant = any(k > end for k, _ in context.each(*_LANDING_SEQUENCES))
    if rest and not meant and not any((target or 0) > end for _, _, target in context.jumps):
        yield at(rest[0], end=end + 1)


def _ends(context: ValidationContext, index: int) -> bool:
    """Tell whether nothing behind the item at `index` is flown."""
    command, dialect = context.items[index].command, context.vehicle.type.dialect
    if command in LANDINGS and dialect.flies_on(context.vehicle):
        return next((after for k, after in context.flying if k > index), 0) not in TAKEOFFS
    return command in dialect.endings


@checks("flies-on")
def _(context: ValidationContext) -> Hits:
    landing = next((k for k, _ in context.each(*LANDINGS)), len(context.items))
    flown = any(k > landing for k, _ in context.flying)
    if flown and not any(_ends(context, k) for k in range(landing + 1)):
        yield at(landing)


@checks("no-ending")
def _(context: ValidationContext) -> Hits:
    if context.items and not any(context.each(*_ENDINGS)):
        does = "hovers" if context.vehicle.type.hovers else "circles"
        yield at(len(context.items) - 1, does=does)


@checks("mixed-heights")
def _(context: ValidationContext) -> Hits:
    sea, home = (
        [k for k, item in context.each(*FLOWN_TO) if item.frame in frames]
        for frames in (ABOVE_SEA, ABOVE_HOME)
    )
    if sea and home:
        yield at(sea[0], other=home[0] + 1)


@checks("jump-target")
def _(context: ValidationContext) -> Hits:
    return (at(index) for index, _, target in context.jumps if target is None)


@checks("jump-forever")
def _(context: ValidationContext) -> Hits:
    for index, item, target in context.jumps:
        if target is not None and target <= index and item.params[1] < 0:
            yield at(index, target=target + 1)


@checks("same-place")
def _(context: ValidationContext) -> Hits:
    for leg in context.legs:
        start, end = leg.start.index, leg.end.index
        if HOME in (start, end) or leg.jump or leg.length >= 0.05:
            continue
        both = {context.items[start].command, context.items[end].command}
        if both == {Command.NAV_WAYPOINT} and abs(leg.rise) < 0.05:
            yield at(end, leg=leg)


@checks("refused-on-upload")
def _(context: ValidationContext) -> Hits:
    dialect = context.vehicle.type.dialect
    for index, item in enumerate(context.items):
        if (refusal := dialect.refusal(dialect.sent(item))) is not None:
            reason, _, instead = refusal.partition("; ")
            yield at(index, reason=reason, instead=instead or _replacement(item))


def _replacement(item: MissionItem) -> str:
    if item.command == Command.NAV_SPLINE_WAYPOINT:
        return "replace it by plain waypoints"
    if item.command in FLOWN_TO and item.frame == Frame.MISSION:
        return "set the frame to 3: height above home"
    if item.command not in FLOWN_TO and item.frame != Frame.MISSION:
        return "set the frame to 2, or remove the item"
    return "remove the item, or use a command that the autopilot has"


@checks("not-set")
def _(context: ValidationContext) -> Hits:
    dialect = context.vehicle.type.dialect
    for index, item in enumerate(context.items):
        refusal = dialect.refusal(item)
        if refusal is not None and dialect.refusal(dialect.sent(item)) is None:
            reason, _, instead = refusal.partition("; ")
            yield at(index, reason=reason, instead=instead)


@checks("number-too-large")
def _(context: ValidationContext) -> Hits:
    for index, item in enumerate(context.items):
        if not fits_message(item):
            largest = max(abs(v) for v in (*item.params, item.z) if not math.isnan(v))
            yield at(index, largest=largest, LARGEST=LARGEST)


@checks("storage-full")
def _(context: ValidationContext) -> Hits:
    return _too_many(context, context.vehicle.type.dialect.items.most, math.inf)


@checks("storage-tight")
def _(context: ValidationContext) -> Hits:
    limit = context.vehicle.type.dialect.items
    return _too_many(context, limit.sure, limit.most)


def _too_many(context: ValidationContext, sure: int, most: float) -> Hits:
    """Tell of more than `sure` rows, and no more than `most`."""
    dialect = context.vehicle.type.dialect
    rows = len(context.items) + dialect.home_row
    if sure < rows <= most and not dialect.unlimited(context.vehicle):
        room = f", or {dialect.make_room}" if dialect.make_room else ""
        home = " with home" if dialect.home_row else ""
        yield at(rows=rows, home=home, sure=sure, room=room)


@checks("many-jumps")
def _(context: ValidationContext) -> Hits:
    limit, jumps = context.vehicle.type.dialect.jumps, [index for index, _, _ in context.jumps]
    if limit is not None and len(jumps) > limit.sure:
        yield at(jumps[limit.sure], count=len(jumps), limit=limit)


_HELD = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TIME)
_RADIUS, _YAW = 1, 3
_MEANING = {_RADIUS: " (acceptance radius)", 2: " (pass-by radius)", _YAW: " (yaw)"}
"""What the parameters of a waypoint mean, counted from 0."""
_INSTEAD = {
    _RADIUS: "set WPNAV_RADIUS (WP_RADIUS_M), which holds for all waypoints",
    _YAW: "put a CONDITION_YAW before the waypoint",
}
"""What to do for them where the vehicle hovers."""


@checks("hold-changed")
def _(context: ValidationContext) -> Hits:
    for index, item, stored in context.stored:
        if item.command not in _HELD or _same(item.params[0], stored.params[0]):
            continue
        instead = "use whole seconds from 0 to 65535, or a NAV_DELAY after a plain waypoint"
        if not context.vehicle.type.hovers and item.command == Command.NAV_WAYPOINT:
            instead = "use NAV_LOITER_TIME: a plane waits in a circle"
        yield at(index, kept=stored.params[0], instead=instead)


@checks("value-dropped")
def _(context: ValidationContext) -> Hits:
    found: dict[tuple[int, int], list[tuple[int, float, float]]] = {}
    for index, item, stored in context.stored:
        for n, (value, kept) in enumerate(zip(item.params, stored.params, strict=True)):
            if item.command not in FLOWN_TO or (n == 0 and item.command in _HELD):
                continue  # a hold is the rule above's
            turned = n == _YAW and _same(value % 360, kept)
            if value != 0 and not turned and not _same(value, kept):
                found.setdefault((item.command, n), []).append((index, value, kept))
    for (command, n), places in found.items():
        index, value, kept = places[0]
        waypoint = command == Command.NAV_WAYPOINT
        meaning = _MEANING.get(n, "") if waypoint else ""
        more = f", and so in {len(places)} items" if places[1:] else ""
        instead = _INSTEAD.get(n) if waypoint and context.vehicle.type.hovers else None
        instead = instead or "write what can be stored"
        told = {"value": value, "kept": kept, "more": more, "instead": instead}
        yield at(index, n=n + 1, meaning=meaning, **told)


def _same(value: float, kept: float) -> bool:
    """Say whether `value` is kept; where it is not set, nothing is lost."""
    return math.isnan(value) or abs(value - kept) <= 1e-4 + 1e-6 * abs(value)
