"""What is refused when a mission is uploaded, and what the vehicle's storage loses of it."""

import math
from collections.abc import Iterator

from faao_mav.autopilot.dialect import name_of
from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.mission.jumps import JUMPS
from faao_mav.validate.context import LARGEST, ValidationContext, fits_message
from faao_mav.validate.rule import Issue, Rules

RULES = Rules()

_PARSERS = (
    "ArduPilot 4.7 AP_Mission::mavlink_int_to_mission_cmd, PX4 1.16 "
    "MavlinkMissionManager::parse_mavlink_mission_item; measured"
)
_SIZES = "ArduPilot: 15 bytes an item; PX4: 1000 items on most boards; measured"


@RULES.error("refused-on-upload", _PARSERS)
def _refused(context: ValidationContext) -> Iterator[Issue]:
    """The autopilot refuses the item, and the mission with it."""
    for index, item in enumerate(context.items):
        dialect = context.vehicle.type.dialect
        reason = dialect.refusal(dialect.sent(item))
        if reason is not None:
            message, _, action = reason.partition("; ")
            if not action:
                action = _replacement(item.command, item.frame)
            yield Issue(index, message, action)


@RULES.warning("not-set", _PARSERS)
def _not_set(context: ValidationContext) -> Iterator[Issue]:
    """A parameter that is not set is sent as 0, because the autopilot refuses NaN."""
    dialect = context.vehicle.type.dialect
    for index, item in enumerate(context.items):
        reason = dialect.refusal(item)
        if reason is not None and dialect.refusal(dialect.sent(item)) is None:
            message, _, action = reason.partition("; ")
            yield Issue(index, f"{message}: `upload` sends 0, other stations may fail", action)


@RULES.error("number-too-large", "MAVLink: MISSION_ITEM_INT has numbers of single precision")
def _too_large(context: ValidationContext) -> Iterator[Issue]:
    """A number that a message cannot carry."""
    for index, item in enumerate(context.items):
        if not fits_message(item):
            largest = max(abs(v) for v in (*item.params, item.z) if not math.isnan(v))
            yield Issue(
                index,
                f"{largest:g} does not fit into a message: numbers are at most {LARGEST:.2g}",
                "correct the number",
            )


def _replacement(command: int, frame: int) -> str:
    if command == Command.NAV_SPLINE_WAYPOINT:
        return "replace it by plain waypoints"
    if command in FLOWN_TO and frame == Frame.MISSION:
        return "set the frame to 3: height above home"
    if command not in FLOWN_TO and frame != Frame.MISSION:
        return "set the frame to 2, or remove the item"
    return "remove the item, or use a command that the autopilot has"


@RULES.error("storage-full", _SIZES)
def _full(context: ValidationContext) -> Iterator[Issue]:
    """More items than any board of the autopilot stores."""
    own = context.vehicle.type
    most = own.dialect.items.most
    return _too_many(context, most, math.inf, f"{own.name} stores {most} at most (NO_SPACE)")


@RULES.warning("storage-tight", _SIZES)
def _tight(context: ValidationContext) -> Iterator[Issue]:
    """More items than common boards store."""
    limit = context.vehicle.type.dialect.items
    return _too_many(
        context, limit.sure, limit.most, f"{limit.sure} are known to fit, boards differ"
    )


def _too_many(context: ValidationContext, sure: int, most: float, limit: str) -> Iterator[Issue]:
    """Yield an issue where there are more than `sure` rows, and no more than `most`."""
    dialect = context.vehicle.type.dialect
    rows = len(context.items) + dialect.home_row
    if sure < rows <= most and not dialect.unlimited(context.vehicle):
        with_home = " with home" if dialect.home_row else ""
        room = filter(None, ("thin the waypoints", dialect.make_room))
        yield Issue(None, f"{rows} items{with_home}; {limit}", ", or ".join(room))


@RULES.warning(
    "many-jumps", "ArduPilot 4.7 AP_MISSION_MAX_NUM_DO_JUMP_COMMANDS: 15, on large boards 100"
)
def _many_jumps(context: ValidationContext) -> Iterator[Issue]:
    """More jumps than the autopilot counts the repeats of."""
    limit = context.vehicle.type.dialect.jumps
    jumps = [index for index, _ in context.each(*JUMPS)]
    if limit is not None and len(jumps) > limit.sure:
        yield Issue(
            jumps[limit.sure],
            f"this is jump number {limit.sure + 1} of {len(jumps)}; boards keep count of "
            f"{limit.sure}, large ones of {limit.most}, and do not jump at the others",
            "write the repeated items out",
        )


_SOURCE = "ArduPilot 4.7 AP_Mission, PX4 1.16 MavlinkMissionManager; read back from both"
_HELD = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TIME)
_MEANING: dict[tuple[int, int], str] = {
    (Command.NAV_WAYPOINT, 1): "acceptance radius",
    (Command.NAV_WAYPOINT, 2): "pass-by radius",
    (Command.NAV_WAYPOINT, 3): "yaw",
}
_INSTEAD: dict[tuple[int, int], str] = {
    (Command.NAV_WAYPOINT, 1): "set WPNAV_RADIUS (WP_RADIUS_M), which holds for all waypoints",
    (Command.NAV_WAYPOINT, 3): "put a CONDITION_YAW before the waypoint",
}
_YAW = 3


@RULES.warning("hold-changed", _SOURCE)
def _hold(context: ValidationContext) -> Iterator[Issue]:
    """A hold is not stored as it is written."""
    for index, item, stored in context.stored:
        if item.command in _HELD and not _same(item.params[0], stored.params[0]):
            flies_on = not context.vehicle.type.hovers and item.command == Command.NAV_WAYPOINT
            yield Issue(
                index,
                f"the hold of {item.params[0]:g} s is stored as {stored.params[0]:g} s",
                "use NAV_LOITER_TIME: a plane waits in a circle"
                if flies_on
                else "use whole seconds from 0 to 65535; for fractions put a NAV_DELAY after a "
                "plain waypoint",
            )


@RULES.note("value-dropped", _SOURCE)
def _dropped(context: ValidationContext) -> Iterator[Issue]:
    """A parameter is not stored as it is written."""
    found: dict[tuple[int, int], list[tuple[int, float, float]]] = {}
    for index, item, stored in context.stored:
        if item.command not in FLOWN_TO:
            continue
        for n, (value, kept) in enumerate(zip(item.params, stored.params, strict=True)):
            if n == 0 and item.command in _HELD:
                continue  # the rule above
            turned = n == _YAW and _same(value % 360, kept)
            if value != 0 and not turned and not _same(value, kept):
                found.setdefault((item.command, n), []).append((index, value, kept))
    for (command, n), places in found.items():
        index, value, kept = places[0]
        meaning = _MEANING.get((command, n))
        which = f"param{n + 1} ({meaning})" if meaning else f"param{n + 1}"
        more = f", and so in {len(places)} items" if len(places) > 1 else ""
        instead = _INSTEAD.get((command, n)) if context.vehicle.type.hovers else None
        yield Issue(
            index,
            f"{which} of {name_of(command)} is {value:g} and is stored as {kept:g}{more}",
            instead or "write what can be stored",
        )


def _same(value: float, kept: float) -> bool:
    """Say whether `value` is kept; where it is not set, nothing is lost."""
    return math.isnan(value) or abs(value - kept) <= 1e-4 + 1e-6 * abs(value)
