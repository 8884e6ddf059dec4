"""Items and their order, and what any autopilot refuses or loses of them."""

import math

from faao_mav.mission.command import (
    ABOVE_HOME,
    ABOVE_SEA,
    FLOWN_TO,
    HOLDING,
    LANDINGS,
    TAKEOFFS,
    Command,
)
from faao_mav.validate.context import LARGEST, ValidationContext, fits_message
from faao_mav.validate.rule import Hits, checks, hit, threshold

_LANDING_SEQUENCES = (Command.DO_LAND_START, 188)
_ENDINGS = (*LANDINGS, Command.NAV_RETURN_TO_LAUNCH, Command.NAV_LOITER_UNLIM)


@checks
def _beside(context: ValidationContext) -> Hits:
    """Whether there is anything, and what stands beside the items."""
    home, back = context.mission.home, context.mission.fence.breach_return
    if not context.items:
        yield hit("empty")
    if context.items and home is None:
        yield hit("no-home")
    if home is not None and not threshold.lowest_land <= home.altitude <= threshold.highest_land:
        told = f"home is {home.altitude:,.0f} m above sea level, where no land is"
        if math.isnan(home.altitude):
            told = "the file has no height of home: heights above sea level are not checked"
        yield hit("home-height", told=told)
    for n, point in enumerate(context.mission.rally, start=1):
        if math.isnan(point.altitude):
            yield hit("rally-height", place=f"rally point {n}")
    if back is not None and math.isnan(back.altitude):
        yield hit("rally-height", place="the return point after a breach")


@checks
def _order(context: ValidationContext) -> Hits:
    """How the mission ends, and what stands behind that."""
    last = len(context.items)
    end = next((k for k in range(last) if _ends(context, k)), last)
    rest = [k for k, _ in context.flying if k > end]
    # A landing sequence, or the target of a jump, is there on purpose.
    meant = any(k > end for k, _ in context.each(*_LANDING_SEQUENCES))
    if rest and not meant and not any((target or 0) > end for _, _, target in context.jumps):
        yield hit("unreachable", rest[0], end=end + 1)
    landing = next((k for k, _ in context.each(*LANDINGS)), last)
    if landing < end and any(k > landing for k, _ in context.flying):
        yield hit("flies-on", landing)
    if context.items and not any(context.each(*_ENDINGS)):
        yield hit("no-ending", last - 1)


def _ends(context: ValidationContext, index: int) -> bool:
    """Tell whether nothing behind the item at `index` is flown."""
    command, dialect = context.items[index].command, context.vehicle.type.dialect
    if command in LANDINGS and dialect.flies_on(context.vehicle):
        return next((after for k, after in context.flying if k > index), 0) not in TAKEOFFS
    return command in dialect.endings


@checks
def _among(context: ValidationContext) -> Hits:
    """Items beside other items: heights, jumps, places."""
    sea, home = (
        [k for k, item in context.each(*FLOWN_TO) if item.frame in frames]
        for frames in (ABOVE_SEA, ABOVE_HOME)
    )
    if sea and home:
        yield hit("mixed-heights", sea[0], other=home[0] + 1)
    jumps, limit = [*context.jumps], context.vehicle.type.dialect.jumps
    for k, item, target in jumps:
        if target is None:
            yield hit("jump-target", k)
        elif target <= k and item.params[1] < 0:
            yield hit("jump-forever", k, target=target + 1)
    if limit is not None and len(jumps) > limit.sure:
        yield hit("many-jumps", jumps[limit.sure][0], count=len(jumps), limit=limit)
    plain = {k for k, _ in context.each(Command.NAV_WAYPOINT)}
    for leg in context.legs:
        level = leg.length < 0.05 and abs(leg.rise) < 0.05
        if level and not leg.jump and {leg.start.index, leg.end.index} <= plain:
            yield hit("same-place", leg.end.index, leg=leg)


@checks
def _refused(context: ValidationContext) -> Hits:
    """What is refused on upload."""
    dialect = context.vehicle.type.dialect
    for k, item in enumerate(context.items):
        unset, refused = dialect.refusal(item), dialect.refusal(dialect.sent(item))
        reason, _, instead = (refused or unset or "").partition("; ")
        if refused is not None:
            instead = instead or "remove the item, or use a command that the autopilot has"
            yield hit("refused-on-upload", k, reason=reason, instead=instead)
        elif unset is not None:
            yield hit("not-set", k, reason=reason, instead=instead)
        if not fits_message(item):
            largest = max(abs(v) for v in (*item.params, item.z) if not math.isnan(v))
            yield hit("number-too-large", k, largest=largest, most=LARGEST)
    rows = len(context.items) + dialect.home_row
    if rows > dialect.items.sure and not dialect.unlimited(context.vehicle):
        rule = "storage-full" if rows > dialect.items.most else "storage-tight"
        room = f", or {dialect.make_room}" if dialect.make_room else ""
        yield hit(rule, rows=rows, fit=dialect.items, room=room)


_YAW = 3
_WAYPOINT = {
    1: (" (acceptance radius)", "set WPNAV_RADIUS (WP_RADIUS_M), which holds for all waypoints"),
    2: (" (pass-by radius)", ""),
    _YAW: (" (yaw)", "put a CONDITION_YAW before the waypoint"),
}
"""Parameters of a waypoint, counted from 0, and what to do for them where the vehicle hovers."""


@checks
def _stored(context: ValidationContext) -> Hits:
    """What the vehicle's storage loses."""
    found: dict[tuple[int, int], list[tuple[int, float, float]]] = {}
    hovers = context.vehicle.type.hovers
    for k, item, stored in context.stored:
        for n, (value, kept) in enumerate(zip(item.params, stored.params, strict=True)):
            turned = n == _YAW and _same(value % 360, kept)
            if _same(value, kept) or turned or item.command not in FLOWN_TO:
                continue
            if n == 0 and item.command in HOLDING:
                instead = "use whole seconds from 0 to 65535, or a NAV_DELAY after a plain waypoint"
                if item.command == Command.NAV_WAYPOINT and not hovers:
                    instead = "use NAV_LOITER_TIME: a plane waits in a circle"
                yield hit("hold-changed", k, kept=kept, instead=instead)
            elif value != 0:
                found.setdefault((item.command, n), []).append((k, value, kept))
    for (command, n), [(k, value, kept), *rest] in found.items():
        more = f", and so in {len(rest) + 1} items" if rest else ""
        meaning, do = _WAYPOINT.get(n, ("", "")) if command == Command.NAV_WAYPOINT else ("", "")
        told = {"value": value, "kept": kept, "meaning": meaning, "more": more}
        told["instead"] = (hovers and do) or "write what can be stored"
        yield hit("value-dropped", k, n=n + 1, **told)


def _same(value: float, kept: float) -> bool:
    """Say whether `value` is kept; where it is not set, nothing is lost."""
    return math.isnan(value) or abs(value - kept) <= 1e-4 + 1e-6 * abs(value)
