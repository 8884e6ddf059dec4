"""What ArduCopter, ArduPlane and PX4 each do with the items they are given.

Read in their sources and measured on ArduCopter 4.7 and PX4 1.16 in simulation.
"""

from typing import TYPE_CHECKING

from faao_mav.mission.item import as_received, as_sent, home_item
from faao_mav.vehicle.ardupilot.dialect import ARDUCOPTER, ARDUPLANE
from faao_mav.vehicle.dialect import Dialect, Limit, SpeedAxis, SpeedChange
from faao_mav.vehicle.px4.dialect import PX4

if TYPE_CHECKING:
    from faao_mav.mission.item import MissionItem
    from faao_mav.mission.vehicle import Vehicle

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
    if vehicle.autopilot == "px4":
        return PX4
    return ARDUPLANE if vehicle.kind == "plane" else ARDUCOPTER


def accepts(item: "MissionItem", vehicle: "Vehicle") -> str | None:
    """Return why the autopilot refuses `item` on upload, None if it takes it."""
    return dialect_of(vehicle).refusal(item)


def as_stored(item: "MissionItem", vehicle: "Vehicle") -> "MissionItem":
    """Return what reading back gives for an `item` that was accepted, as `refusal` tells.

    Numbers went over the wire: parameters and altitude are of single precision, degrees multiples
    of 1e-7. What the autopilot has no room for is gone.
    """
    return dialect_of(vehicle).stored(item)


def storage_known(command: int, vehicle: "Vehicle") -> bool:
    """Say whether it is known what the autopilot keeps of `command`.

    Of the others `as_stored` takes everything to be kept.
    """
    known = dialect_of(vehicle).known
    return known is None or command in known


def item_limit(vehicle: "Vehicle") -> Limit:
    """Return how many items the autopilot stores, the home row included where it has one."""
    return dialect_of(vehicle).items


def speed_change(item: "MissionItem", vehicle: "Vehicle") -> SpeedChange | None:
    """Return what a DO_CHANGE_SPEED changes, None for one that changes nothing."""
    return dialect_of(vehicle).speed_change(item)
