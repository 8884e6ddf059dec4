"""What the autopilot's storage loses of the items that it takes."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import FLOWN_TO, Command
from faao_mav.mission.item import MissionItem
from faao_mav.validate.case import Case, fits_message
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vehicle.dialect import name_of
from faao_mav.vehicle.dialects import accepts, as_stored

RULES = Rules()

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


@RULES.add("hold-changed", Level.WARNING, "a hold is not stored as it is written", _SOURCE)
def _hold(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_HELD):
        stored = _stored(case, item)
        if stored is not None and not _same(item.params[0], stored.params[0]):
            flies_on = case.vehicle.kind == "plane" and item.command == Command.NAV_WAYPOINT
            yield Issue(
                index,
                f"the hold of {item.params[0]:g} s is stored as {stored.params[0]:g} s",
                "use NAV_LOITER_TIME: a plane waits in a circle"
                if flies_on
                else "use whole seconds from 0 to 65535; for fractions put a NAV_DELAY after a "
                "plain waypoint",
            )


@RULES.add("value-dropped", Level.NOTE, "a parameter is not stored as it is written", _SOURCE)
def _dropped(case: Case) -> Iterator[Issue]:
    found: dict[tuple[int, int], list[tuple[int, float, float]]] = {}
    for index, item in case.each(*FLOWN_TO):
        stored = _stored(case, item)
        if stored is None:
            continue
        for n, (value, kept) in enumerate(zip(item.params, stored.params, strict=True)):
            if n == 0 and item.command in _HELD:
                continue  # the rule above
            turned = n == _YAW and case.vehicle.autopilot == "px4"  # kept as 0 to 360 degrees
            if value != 0 and not turned and not _same(value, kept):
                found.setdefault((item.command, n), []).append((index, value, kept))
    for (command, n), places in found.items():
        index, value, kept = places[0]
        meaning = _MEANING.get((command, n))
        which = f"param{n + 1} ({meaning})" if meaning else f"param{n + 1}"
        more = f", and so in {len(places)} items" if len(places) > 1 else ""
        instead = _INSTEAD.get((command, n)) if case.vehicle.kind == "copter" else None
        yield Issue(
            index,
            f"{which} of {name_of(command)} is {value:g} and is stored as {kept:g}{more}",
            instead or "write what can be stored",
        )


@RULES.add(
    "altitude-rounded",
    Level.NOTE,
    "an altitude is stored in whole centimetres",
    _SOURCE,
    autopilot="ardupilot",
)
def _altitude(case: Case) -> Iterator[Issue]:
    changed = []
    for index, item in case.each(*FLOWN_TO):
        stored = _stored(case, item)
        if stored is not None and abs(stored.z - item.z) > 1e-4 * max(1.0, abs(item.z)):
            changed.append((index, item.z, stored.z))
    if changed:
        index, z, kept = changed[0]
        more = f", and so in {len(changed)} items" if len(changed) > 1 else ""
        yield Issue(
            index,
            f"the altitude of {z:g} m is stored as {kept:.2f} m{more}",
            "nothing, unless centimetres matter",
        )


def _stored(case: Case, item: MissionItem) -> MissionItem | None:
    """Return what is read back for `item`, None if it is refused."""
    if not fits_message(item) or accepts(item, case.vehicle):
        return None
    return as_stored(item, case.vehicle)


def _same(value: float, kept: float) -> bool:
    """Say whether `value` is kept; where it is not set, nothing is lost."""
    return math.isnan(value) or abs(value - kept) <= 1e-4 + 1e-6 * abs(value)
