"""What the files of missions and parameters say of a vehicle, and what they are to say."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from faao_mav.autopilot.vehicle import Vehicle, families, kind_by_number
from faao_mav.autopilot.vehicle_type import VehicleType
from faao_mav.mission.formats import MissionFile, PlanTarget


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


@dataclass(frozen=True, slots=True)
class MadeFor:
    """For whom a mission was made, as far as that is told, and what told it (`by`).

    `kind` is a type of vehicle, or the MAV_TYPE of one that is not known here in words.
    """

    autopilot: str | None = None
    kind: str | None = None
    by: str = ""


def made_for(path: Path, file: MissionFile, planned: Vehicle | None = None) -> MadeFor:
    """Return for whom the mission that was read from `path` was made.

    The vehicle of its plan tells, else the file, else whose file of parameters lies beside it.
    """
    if planned is not None:
        return MadeFor(planned.autopilot, planned.kind, "as the plan says")
    if file.firmware is not None:
        keys = [key for key, each in families().items() if each.mav_autopilot == file.firmware]
        kind = None
        if file.vehicle_type:
            unknown = f"vehicle of MAV_TYPE {file.vehicle_type}"
            kind = kind_by_number(file.vehicle_type) or unknown
        return MadeFor(keys[0] if keys else None, kind, "as the file says")
    beside = [each for each in families() if parameter_path(path, each).is_file()]
    if len(beside) != 1:
        return MadeFor()
    return MadeFor(beside[0], None, f"as {parameter_path(path, beside[0]).name} beside it says")


def addressee_mistake(made_for: MadeFor, vehicle: VehicleType) -> str | None:
    """Return in words that a mission was made for another autopilot or type; None if it was not."""
    autopilot, kind = vehicle.family.key, vehicle.kind
    if made_for.autopilot in (None, autopilot) and made_for.kind in (None, kind):
        return None
    whose = made_for.autopilot or "any autopilot"
    told = f"{whose} and a {made_for.kind}" if made_for.kind else whose
    return f"the mission is for {told} ({made_for.by}), the vehicle is {autopilot} and a {kind}"


def parameter_path(mission: Path, autopilot: str) -> Path:
    """Return the file of parameters beside `mission`.

    >>> parameter_path(Path("flight.plan"), "px4").name
    'flight.params'
    """
    return mission.with_suffix(families()[autopilot].parameter_suffix)


def autopilot_of(parameters: Iterable[str]) -> str | None:
    """Return whose names `parameters` are, None where they do not tell."""
    names = tuple(parameters)
    found = [
        key
        for key, each in families().items()
        if any(name.startswith(each.parameter_prefixes) for name in names)
    ]
    return found[0] if len(found) == 1 else None
