"""Rules about items and their order that hold for every autopilot."""

import math
from collections.abc import Iterator

from faao_mav.autopilot.dialect import name_of
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, FLOWN_TO, LANDINGS, TAKEOFFS, Command
from faao_mav.mission.jumps import JUMPS
from faao_mav.validate.context import NAV_LAST, ValidationContext, number
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME

RULES = Rules()

_COMMON = "MAVLink: mission protocol"
_RETURN_PATH_START = 188
_ENDINGS = LANDINGS | {Command.NAV_RETURN_TO_LAUNCH, Command.NAV_LOITER_UNLIM}


@RULES.error("empty", _COMMON)
def _empty(context: ValidationContext) -> Iterator[Issue]:
    """The mission has no items."""
    if not context.items:
        yield Issue(
            None,
            "the mission has no items: uploading it clears what the vehicle has",
            "add a take-off, waypoints and a landing",
        )


@RULES.warning("no-home", _COMMON)
def _no_home(context: ValidationContext) -> Iterator[Issue]:
    """The file says nothing about home."""
    if context.items and context.mission.home is None:
        yield Issue(
            None,
            "the file has no home position: distances from home, heights above sea level and the "
            "way back are not checked",
            "set the planned home in the ground station, or fill row 0 of the file",
        )


_LAND = (-430.0, 8849.0)
"""The lowest and the highest land on Earth, m above sea level: the Dead Sea's shore, Everest."""


@RULES.warning("home-height", "geography")
def _home_height(context: ValidationContext) -> Iterator[Issue]:
    """The height of home is not known, or that of no place on land."""
    home = context.mission.home
    if home is None or _LAND[0] <= home.altitude <= _LAND[1]:
        return
    action = "set the height of the planned home, metres above sea level"
    if math.isnan(home.altitude):
        told = "the file has no height of home: heights above sea level are not checked"
        yield Issue(None, told, action)
    else:
        told = f"home is {home.altitude:,.0f} m above sea level, where no land is"
        yield Issue(None, told, f"{action}, not feet or millimetres")


@RULES.warning("rally-height", _COMMON)
def _rally_height(context: ValidationContext) -> Iterator[Issue]:
    """A place to return to has no height."""
    action, back = "give its height, metres above home", context.mission.fence.breach_return
    for n, point in enumerate(context.mission.rally, start=1):
        if math.isnan(point.altitude):
            yield Issue(None, f"rally point {n} has no altitude: `upload` refuses it", action)
    if back is not None and math.isnan(back.altitude):
        told = "the return point after a breach has no altitude: the vehicle's parameters set it"
        yield Issue(None, told, action)


@RULES.warning("unreachable", "measured on ArduCopter and ArduPlane 4.7 and PX4 1.16.1")
def _unreachable(context: ValidationContext) -> Iterator[Issue]:
    """Items stand after one that ends the mission."""
    end = next((k for k in range(len(context.items)) if _ends(context, k)), len(context.items))
    after = context.items[end + 1 :]
    rest = [k for k, item in enumerate(after, end + 1) if item.command <= NAV_LAST]
    # A landing sequence, or the target of a jump, is there on purpose.
    if any(item.command in (Command.DO_LAND_START, _RETURN_PATH_START) for item in after):
        return
    targets = [context.jump_target(index) or 0 for index, _ in context.each(*JUMPS)]
    if rest and max(targets, default=0) <= end:
        span = f"items {number(rest[0])} to {number(rest[-1])} are" if rest[1:] else "this item is"
        yield Issue(
            rest[0],
            f"{span} never flown: item {number(end)} ends the mission",
            f"remove item {number(end)}, or what follows it",
        )


def _ends(context: ValidationContext, index: int) -> bool:
    """Tell whether nothing behind the item at `index` is flown."""
    command, dialect = context.items[index].command, context.vehicle.type.dialect
    if command in LANDINGS and dialect.flies_on(context.vehicle):
        after = (item.command for item in context.items[index + 1 :] if item.command <= NAV_LAST)
        return next(after, 0) not in TAKEOFFS
    return command in dialect.endings


@RULES.warning("flies-on", "measured on ArduCopter 4.7 (MIS_OPTIONS 4) and PX4 1.16.1")
def _flies_on(context: ValidationContext) -> Iterator[Issue]:
    """Items stand after a landing: the aircraft takes off again by itself."""
    for index, _ in context.each(*LANDINGS):
        flown = any(item.command <= NAV_LAST for item in context.items[index + 1 :])
        if flown and not any(_ends(context, k) for k in range(index + 1)):
            yield Issue(
                index,
                "the landing is not the end: the aircraft lands, takes off by itself and flies on",
                "remove what follows, unless everyone on the ground knows",
            )
            return


@RULES.note("no-ending", _COMMON)
def _no_ending(context: ValidationContext) -> Iterator[Issue]:
    """The mission ends neither in a landing nor in a return."""
    if context.items and not any(item.command in _ENDINGS for item in context.items):
        what = "hovers" if context.vehicle.type.hovers else "circles"
        yield Issue(
            len(context.items) - 1,
            f"after the last item the aircraft {what} where it is until someone takes over",
            "add NAV_RETURN_TO_LAUNCH or NAV_LAND, unless that is what you want",
        )


@RULES.note("mixed-heights", _COMMON)
def _mixed_heights(context: ValidationContext) -> Iterator[Issue]:
    """Some heights count from sea level, others from home."""
    frames = [(k, item.frame) for k, item in context.each(*FLOWN_TO)]
    sea = next((k for k, frame in frames if frame in ABOVE_SEA), None)
    home = next((k for k, frame in frames if frame in ABOVE_HOME), None)
    if sea is not None and home is not None:
        yield Issue(
            sea,
            f"the height counts from sea level (frame {context.items[sea].frame}), that of item "
            f"{number(home)} from home (frame {context.items[home].frame})",
            "use one of both, unless you mean it",
        )


@RULES.error("jump-target", _COMMON)
def _jump_target(context: ValidationContext) -> Iterator[Issue]:
    """A jump goes to an item that does not exist."""
    for index, item in context.each(*JUMPS):
        if context.jump_target(index) is not None:
            continue
        if item.command == Command.DO_JUMP_TAG:
            yield Issue(
                index,
                f"DO_JUMP_TAG goes to tag {item.params[0]:g}, which no JUMP_TAG has",
                "add the JUMP_TAG, or correct the number",
            )
        else:
            yield Issue(
                index,
                f"DO_JUMP goes to item {item.params[0]:g}; there are items 1 to "
                f"{len(context.items)}",
                "correct param1",
            )


@RULES.warning("jump-forever", _COMMON)
def _jump_forever(context: ValidationContext) -> Iterator[Issue]:
    """A jump repeats without end."""
    for index, item in context.each(*JUMPS):
        target = context.jump_target(index)
        if target is not None and target <= index and item.params[1] < 0:
            yield Issue(
                index,
                f"{name_of(item.command)} to item {number(target)} has the repeat count "
                f"{item.params[1]:g}: it never ends and what follows is never flown",
                "give the number of repeats in param2, or be ready to take over",
            )


@RULES.note("same-place", _COMMON)
def _same_place(context: ValidationContext) -> Iterator[Issue]:
    """Two waypoints in a row are the same place."""
    for leg in context.legs:
        start, end = leg.start.index, leg.end.index
        if HOME in (start, end) or leg.jump or leg.length >= 0.05:
            continue
        both = {context.items[start].command, context.items[end].command}
        if both == {Command.NAV_WAYPOINT} and abs(leg.rise) < 0.05:
            yield Issue(
                end,
                f"the same place as item {number(start)}, {leg.length:.2f} m away",
                "remove one of both; to wait there, give the first a hold (param1)",
            )
