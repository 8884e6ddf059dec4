"""What the files of missions and parameters say of a vehicle, and what they are to say."""

from collections.abc import Iterable
from pathlib import Path

from faao_mav.mission.formats import MissionFile, PlanTarget
from faao_mav.mission.formats.parameter_file import ParameterStyle
from faao_mav.mission.vehicle import Autopilot, Kind, Vehicle

FIRMWARE: dict[Autopilot, int] = {"ardupilot": 3, "px4": 12}
"""MAV_AUTOPILOT of each autopilot."""

VEHICLE_TYPES: dict[Kind, tuple[int, ...]] = {"copter": (2, 3, 4, 13, 14, 15), "plane": (1,)}
"""MAV_TYPE of each kind of vehicle; the first is the one to write."""

PARAMETER_STYLE: dict[Autopilot, ParameterStyle] = {
    "ardupilot": "name-value",
    "px4": "qgroundcontrol",
}

_OF_PX4 = ("MPC_", "NAV_", "COM_", "EKF2_")
_OF_ARDUPILOT = ("WPNAV_", "WP_", "ATC_", "PSC_", "ARMING_")


def plan_target(vehicle: Vehicle | None) -> PlanTarget | None:
    """Return whom a `.plan` for `vehicle` is for; ArduPilot refuses null."""
    if vehicle is None:
        return None
    numbers = FIRMWARE[vehicle.autopilot], VEHICLE_TYPES[vehicle.kind][0]
    return PlanTarget(*numbers, takes_null=vehicle.autopilot != "ardupilot")


def vehicle_in(file: MissionFile) -> Vehicle | None:
    """Return the vehicle that a mission file names, a copter unless it says otherwise, or None."""
    autopilot = next((name for name, own in FIRMWARE.items() if own == file.firmware), None)
    return None if autopilot is None else Vehicle(autopilot, kind_in(file) or "copter")


def kind_in(file: MissionFile) -> Kind | None:
    """Return the kind of aircraft that a mission file names, if any."""
    return next((name for name, own in VEHICLE_TYPES.items() if file.vehicle_type in own), None)


def parameter_path(mission: Path, autopilot: Autopilot) -> Path:
    """Return the file of parameters beside `mission`: `.param`, or `.params` for PX4."""
    return mission.with_suffix(".params" if autopilot == "px4" else ".param")


def autopilot_of(parameters: Iterable[str]) -> Autopilot | None:
    """Return whose names `parameters` are, None where they do not tell."""
    names = tuple(parameters)
    px4 = any(name.startswith(_OF_PX4) for name in names)
    ardupilot = any(name.startswith(_OF_ARDUPILOT) for name in names)
    if px4 == ardupilot:
        return None
    return "px4" if px4 else "ardupilot"
