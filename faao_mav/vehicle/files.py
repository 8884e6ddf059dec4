"""What the files of missions and parameters say of a vehicle, and what they are to say."""

from collections.abc import Iterable
from pathlib import Path

from faao_mav.mission.formats import MissionFile, PlanTarget
from faao_mav.plan.autopilots import Autopilot
from faao_mav.vehicle.vehicle import Vehicle, families, family, vehicle_type_by_numbers


def plan_target(vehicle: Vehicle | None) -> PlanTarget | None:
    """Return whom a `.plan` file for `vehicle` is for.

    >>> plan_target(Vehicle("px4", "copter"))
    PlanTarget(firmware=12, vehicle_type=2, takes_null=True)
    """
    if vehicle is None:
        return None
    own = vehicle.type
    return PlanTarget(
        own.family.mav_autopilot, own.mav_types[0], takes_null=not own.dialect.unset_is_zero
    )


def vehicle_in(file: MissionFile) -> Vehicle | None:
    """Return the vehicle that a mission file names, None if it names none that is known.

    The type is the autopilot's first where the file leaves it open (MAV_TYPE 0).
    """
    if file.firmware is None:
        return None
    found = vehicle_type_by_numbers(file.firmware, file.vehicle_type or None)
    return None if found is None else Vehicle(found.family.key, found.kind)


def parameter_path(mission: Path, autopilot: Autopilot) -> Path:
    """Return the file of parameters beside `mission`.

    >>> parameter_path(Path("flight.plan"), "px4").name
    'flight.params'
    """
    return mission.with_suffix(family(autopilot).parameter_suffix)


def autopilot_of(parameters: Iterable[str]) -> Autopilot | None:
    """Return whose names `parameters` are, None where they do not tell."""
    names = tuple(parameters)
    found = [
        each.key
        for each in families()
        if any(name.startswith(each.parameter_prefixes) for name in names)
    ]
    return found[0] if len(found) == 1 else None
