"""Rules about items and their order that hold for every autopilot."""

from collections.abc import Iterator

from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, FLOWN_TO, Command
from faao_mav.validate.case import HOME, NAV_LAST, Case, number
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules

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


@RULES.add("empty", Level.ERROR, "the mission has no items", _COMMON)
def _empty(case: Case) -> Iterator[Issue]:
    if not case.items:
        yield Issue(
            None,
            "the mission has no items: uploading it clears what the vehicle has",
            "add a take-off, waypoints and a landing",
        )


@RULES.add("no-home", Level.WARNING, "the file says nothing about home", _COMMON)
def _no_home(case: Case) -> Iterator[Issue]:
    if case.items and case.mission.home is None:
        yield Issue(
            None,
            "the file has no home position: distances from home, heights above sea level and the "
            "way back are not checked",
            "set the planned home in the ground station, or fill row 0 of the file",
        )


@RULES.add("unreachable", Level.WARNING, "items stand after one that ends the mission", _COMMON)
def _unreachable(case: Case) -> Iterator[Issue]:
    end = next((k for k, item in enumerate(case.items) if item.command in _ENDINGS), None)
    if end is None:
        return
    rest = [k for k in range(end + 1, len(case.items)) if case.items[k].command <= NAV_LAST]
    # A landing sequence, a second take-off, or the target of a jump is there on purpose.
    deliberate = {Command.DO_LAND_START, _RETURN_PATH_START, *_TAKEOFFS}
    if (
        not rest
        or any(case.items[k].command in deliberate for k in range(end + 1, len(case.items)))
        or any((case.jump_target(k) or 0) > end for k, _ in case.each(Command.DO_JUMP))
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


@RULES.add(
    "no-ending", Level.NOTE, "the mission ends neither in a landing nor in a return", _COMMON
)
def _no_ending(case: Case) -> Iterator[Issue]:
    if case.items and not any(item.command in _ENDINGS for item in case.items):
        what = "circles" if case.vehicle.kind == "plane" else "hovers"
        yield Issue(
            len(case.items) - 1,
            f"after the last item the aircraft {what} where it is until someone takes over",
            "add NAV_RETURN_TO_LAUNCH or NAV_LAND, unless that is what you want",
        )


@RULES.add(
    "mixed-heights", Level.NOTE, "some heights count from sea level, others from home", _COMMON
)
def _mixed_heights(case: Case) -> Iterator[Issue]:
    frames = [(k, item.frame) for k, item in case.each(*FLOWN_TO)]
    sea = next((k for k, frame in frames if frame in ABOVE_SEA), None)
    home = next((k for k, frame in frames if frame in ABOVE_HOME), None)
    if sea is not None and home is not None:
        yield Issue(
            sea,
            f"the height counts from sea level (frame {case.items[sea].frame}), that of item "
            f"{number(home)} from home (frame {case.items[home].frame})",
            "use one of both, unless you mean it",
        )


@RULES.add("jump-target", Level.ERROR, "a DO_JUMP goes to an item that does not exist", _COMMON)
def _jump_target(case: Case) -> Iterator[Issue]:
    for index, item in case.each(Command.DO_JUMP):
        if case.jump_target(index) is None:
            yield Issue(
                index,
                f"DO_JUMP goes to item {item.params[0]:g}; there are items 1 to {len(case.items)}",
                "correct param1",
            )


@RULES.add("jump-forever", Level.WARNING, "a DO_JUMP repeats without end", _COMMON)
def _jump_forever(case: Case) -> Iterator[Issue]:
    for index, item in case.each(Command.DO_JUMP):
        target = case.jump_target(index)
        if target is not None and target <= index and item.params[1] < 0:
            yield Issue(
                index,
                f"DO_JUMP to item {number(target)} has the repeat count {item.params[1]:g}: it "
                "never ends and what follows is never flown",
                "give the number of repeats in param2, or be ready to take over",
            )


@RULES.add("jump-in-place", Level.ERROR, "a DO_JUMP loops over items that do not fly", _COMMON)
def _jump_in_place(case: Case) -> Iterator[Issue]:
    for index, _ in case.each(Command.DO_JUMP):
        target = case.jump_target(index)
        if target is not None and target <= index:
            loop = case.items[target:index]
            if not any(item.command <= NAV_LAST for item in loop):
                yield Issue(
                    index,
                    f"the loop from item {number(target)} to here flies nowhere: the autopilot "
                    "gives up the mission",
                    "jump to a waypoint, or remove the jump",
                )


@RULES.add("same-place", Level.NOTE, "two waypoints in a row are the same place", _COMMON)
def _same_place(case: Case) -> Iterator[Issue]:
    for leg in case.legs:
        start, end = leg.start.index, leg.end.index
        if HOME in (start, end) or leg.jump or leg.length >= 0.05:
            continue
        both = {case.items[start].command, case.items[end].command}
        if both == {Command.NAV_WAYPOINT} and abs(leg.rise) < 0.05:
            yield Issue(
                end,
                f"the same place as item {number(start)}, {leg.length:.2f} m away",
                "remove one of both; to wait there, give the first a hold (param1)",
            )
