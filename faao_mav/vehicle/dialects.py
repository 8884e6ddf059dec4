"""Questions about a vehicle's items by other names, until their callers ask `Vehicle.type`."""

from typing import TYPE_CHECKING

from faao_mav.mission.rows import as_received, as_sent, home_item
from faao_mav.vehicle.dialect import Dialect, Limit, SpeedAxis, SpeedChange

if TYPE_CHECKING:
    from faao_mav.mission.item import MissionItem
    from faao_mav.vehicle.vehicle import Vehicle

__all__ = [
    "Dialect",
    "Limit",
    "SpeedAxis",
    "SpeedChange",
    "accepts",
    "as_received",
    "as_sent",
    "as_stored",
    "dialect_of",
    "home_item",
    "item_limit",
    "speed_change",
    "storage_known",
]


def dialect_of(vehicle: "Vehicle") -> Dialect:
    """Return what the autopilot of `vehicle` does with items."""
    return vehicle.type.dialect


def accepts(item: "MissionItem", vehicle: "Vehicle") -> str | None:
    """Return why the autopilot refuses `item` on upload, None if it takes it."""
    return vehicle.type.dialect.refusal(item)


def as_stored(item: "MissionItem", vehicle: "Vehicle") -> "MissionItem":
    """Return what reading back gives for an `item` that was accepted."""
    return vehicle.type.dialect.stored(item)


def storage_known(command: int, vehicle: "Vehicle") -> bool:
    """Say whether it is known what the autopilot keeps of `command`."""
    return vehicle.type.dialect.is_known(command)


def item_limit(vehicle: "Vehicle") -> Limit:
    """Return how many items the autopilot stores, the home row included where it has one."""
    return vehicle.type.dialect.items


def speed_change(item: "MissionItem", vehicle: "Vehicle") -> SpeedChange | None:
    """Return what a DO_CHANGE_SPEED changes, None for one that changes nothing."""
    return vehicle.type.dialect.speed_change(item)
