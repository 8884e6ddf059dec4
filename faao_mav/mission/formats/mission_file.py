"""What a mission file tells, and whom it is for."""

from dataclasses import dataclass

from faao_mav.mission.item import Mission


@dataclass(frozen=True, slots=True)
class MissionFile:
    """A mission, for whom it was made as far as the file says it, and what was odd about it.

    `firmware` is a MAV_AUTOPILOT and `vehicle_type` a MAV_TYPE, which only `.plan` files hold.
    `warnings` are lines that name file and place.
    """

    mission: Mission
    firmware: int | None = None
    vehicle_type: int | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanTarget:
    """Whom a `.plan` file is written for: a MAV_AUTOPILOT and a MAV_TYPE, 0 for a generic one.

    `takes_null`: whether that autopilot is sent null, not set, or 0 instead because it refuses it.
    """

    firmware: int
    vehicle_type: int
    takes_null: bool = True
