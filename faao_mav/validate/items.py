"""Rules about items and their order that hold for every autopilot."""

from collections.abc import Iterator

from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, FLOWN_TO, Command
from faao_mav.validate.context import NAV_LAST, ValidationContext, number
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME

RULES = Rules()

_COMMON = "MAVLink: mission protocol"
_RETURN_PATH_START = 188
_ENDINGS = frozenset(
    {
        Command.NAV_RETURN_TO_LAUNCH,
        Command.NAV_LAND,
        Command.NAV_VTOL_LAND,
        Command.NAV_LOITER_UNLIM,
    }
)
_TAKEOFFS = frozenset({Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF})


@RULES.error("empty", "the mission has no items", _COMMON)
def _empty(context: ValidationContext) -> Iterator[Issue]:
    if not context.items:
        yield Issue(
            None,
            "the mission has no items: uploading it clears what the vehicle has",
            "add a take-off, waypoints and a landing",
        )


@RULES.warning("no-home", "the file says nothing about home", _COMMON)
def _no_home(context: ValidationContext) -> Iterator[Issue]:
    if context.items and context.mission.home is None:
        yield Issue(
            None,
            "the file has no home position: distances from home, heights above sea level and the "
            "way back are not checked",
            "set the planned home in the ground station, or fill row 0 of the file",
        )


@RULES.warning("unreachable", "items stand after one that ends the mission", _COMMON)
def _unreachable(context: ValidationContext) -> Iterator[Issue]:
    end = next((k for k, item in enumerate(context.items) if item.command in _ENDINGS), None)
    if end is None:
        return
    rest = [k for k in range(end + 1, len(context.items)) if context.items[k].command <= NAV_LAST]
    # A landing sequence, a second take-off, or the target of a jump is there on purpose.
    deliberate = {Command.DO_LAND_START, _RETURN_PATH_START, *_TAKEOFFS}
    if (
        not rest
        or any(context.items[k].command in deliberate for k in range(end + 1, len(context.items)))
        or any((context.jump_target(k) or 0) > end for k, _ in context.each(Command.DO_JUMP))
    ):
        return
    last = number(rest[-1])
    yield Issue(
        rest[0],
        f"items {number(rest[0])} to {last} are never flown: item {number(end)} ends the mission"
        if len(rest) > 1
        else f"this item is never flown: item {number(end)} ends the mission",
        f"remove item {number(end)}, or what follows it",
    )


@RULES.note("no-ending", "the mission ends neither in a landing nor in a return", _COMMON)
def _no_ending(context: ValidationContext) -> Iterator[Issue]:
    if context.items and not any(item.command in _ENDINGS for item in context.items):
        what = "hovers" if context.vehicle.type.hovers else "circles"
        yield Issue(
            len(context.items) - 1,
            f"after the last item the aircraft {what} where it is until someone takes over",
            "add NAV_RETURN_TO_LAUNCH or NAV_LAND, unless that is what you want",
        )


@RULES.note("mixed-heights", "some heights count from sea level, others from home", _COMMON)
def _mixed_heights(context: ValidationContext) -> Iterator[Issue]:
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


@RULES.error("jump-target", "a DO_JUMP goes to an item that does not exist", _COMMON)
def _jump_target(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(Command.DO_JUMP):
        if context.jump_target(index) is None:
            yield Issue(
                index,
                f"DO_JUMP goes to item {item.params[0]:g}; there are items 1 to "
                f"{len(context.items)}",
                "correct param1",
            )


@RULES.warning("jump-forever", "a DO_JUMP repeats without end", _COMMON)
def _jump_forever(context: ValidationContext) -> Iterator[Issue]:
    for index, item in context.each(Command.DO_JUMP):
        target = context.jump_target(index)
        if target is not None and target <= index and item.params[1] < 0:
            yield Issue(
                index,
                f"DO_JUMP to item {number(target)} has the repeat count {item.params[1]:g}: it "
                "never ends and what follows is never flown",
                "give the number of repeats in param2, or be ready to take over",
            )


@RULES.error("jump-in-place", "a DO_JUMP loops over items that do not fly", _COMMON)
def _jump_in_place(context: ValidationContext) -> Iterator[Issue]:
    for index, _ in context.each(Command.DO_JUMP):
        target = context.jump_target(index)
        if target is not None and target <= index:
            loop = context.items[target:index]
            if not any(item.command <= NAV_LAST for item in loop):
                yield Issue(
                    index,
                    f"the loop from item {number(target)} to here flies nowhere: the autopilot "
                    "gives up the mission",
                    "jump to a waypoint, or remove the jump",
                )


@RULES.note("same-place", "two waypoints in a row are the same place", _COMMON)
def _same_place(context: ValidationContext) -> Iterator[Issue]:
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
