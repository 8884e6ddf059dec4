"""Missions as the rows that go over the wire, numbered from 0, and back."""

from collections.abc import Sequence
from dataclasses import replace

from faao_mav.mission.command import Command, Frame
from faao_mav.mission.item import Home, Mission, MissionItem


def home_item(home: Home | None) -> MissionItem:
    """Return the row 0 that stands for `home`; zeros for none."""
    known = home or Home(0.0, 0.0, 0.0)
    return MissionItem(
        Command.NAV_WAYPOINT, Frame.GLOBAL, x=known.latitude, y=known.longitude, z=known.altitude
    )


def as_sent(mission: Mission, *, home_row: bool) -> tuple[MissionItem, ...]:
    """Return the items to send, the first as number 0.

    With a home row (ArduPilot) row 0 is the home, zeros if there is none: the vehicle puts its
    own there. Without one (PX4) the targets of DO_JUMP, which count items from 1, count from 0.
    """
    if not home_row:
        return tuple(_jump_moved(item, -1) for item in mission.items)
    return (home_item(mission.home), *mission.items)


def as_received(rows: Sequence[MissionItem], *, home_row: bool) -> Mission:
    """Return the mission that was read back as `rows`: the reverse of `as_sent`."""
    if not home_row:
        return Mission(tuple(_jump_moved(item, 1) for item in rows))
    if not rows:
        return Mission(())
    first = rows[0]
    home = None if first.x == first.y == first.z == 0 else Home(first.x, first.y, first.z)
    return Mission(tuple(rows[1:]), home)


def _jump_moved(item: MissionItem, by: int) -> MissionItem:
    if item.command != Command.DO_JUMP:
        return item
    return replace(item, params=(item.params[0] + by, *item.params[1:]))
