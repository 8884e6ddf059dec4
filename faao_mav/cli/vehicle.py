"""Who flies a mission file: what tells, and in which order it is believed."""

from pathlib import Path
from typing import TYPE_CHECKING

from faao_mav.autopilot import (
    Autopilot,
    Kind,
    Vehicle,
    autopilots,
    family,
    kind_by_number,
    kinds,
)
from faao_mav.autopilot.files import autopilot_of, parameter_path, vehicle_in
from faao_mav.errors import InputError
from faao_mav.mission.formats.parameter_file import read_parameters

if TYPE_CHECKING:
    from faao_mav.mission.formats import MissionFile
    from faao_mav.plan import Plan


def choose_vehicle(
    mission_file: Path,
    file: "MissionFile",
    plan: "Plan | None",
    asked: tuple[Autopilot | None, Kind | None, Path | None],
) -> tuple[Vehicle, str]:
    """Return the vehicle, and what told which.

    `asked` are --autopilot, --type and --parameters. What they leave open the plan says, else the
    mission's file, else the names of the parameters. The parameters are those asked for, else
    those beside the mission, over the plan's own. Raises `InputError` for parameters of another
    autopilot than the mission's, for files of several autopilots beside a mission that does not
    say whose it is, and for a mission of a type of vehicle that is unknown here.
    """
    autopilot, kind, parameters = asked
    given = read_parameters(parameters) if parameters is not None else None
    base, chosen_by = told_vehicle(mission_file, file, plan, given, asked) or (
        Vehicle(),
        "by default; --autopilot and --type say otherwise",
    )
    if autopilot is not None or kind is not None:
        chosen_by = "as asked"
    whose = autopilot or base.autopilot
    values, source = base.parameters, base.source
    if whose != base.autopilot:
        values = {}
    beside = parameter_path(mission_file, whose)
    if given is not None:
        values, source = given, str(parameters)
    elif beside.is_file():
        given, parameters = read_parameters(beside), beside
        values, source = {**values, **given}, f"{beside}, beside the mission"
    theirs = autopilot_of(given) if given is not None else None
    if theirs is not None and theirs != whose:
        raise InputError(
            f"{parameters}: parameters of {family(theirs).name}, but the mission is for "
            f"{family(whose).name} ({chosen_by}): "
            f"give the vehicle's own (--parameters), or --autopilot {theirs}"
        )
    body = base.body if (whose, kind or base.kind) == (base.autopilot, base.kind) else None
    return Vehicle(whose, kind or base.kind, values, source, body), chosen_by


def told_vehicle(
    mission_file: Path,
    file: "MissionFile",
    plan: "Plan | None",
    given: dict[str, float] | None,
    asked: tuple[Autopilot | None, Kind | None, Path | None],
) -> tuple[Vehicle, str] | None:
    """Return what plan, mission and parameters say of the vehicle, and which of them it was.

    None where nothing tells. Arguments and errors are those of `choose_vehicle`; `given` is what
    the file of parameters that was asked for holds.
    """
    if plan is not None:
        return plan.aircraft, "as the plan says"
    named = vehicle_in(file)
    if named is not None:
        return named, "as the file says"
    autopilot, kind, _ = asked
    if file.vehicle_type and kind is None and kind_by_number(file.vehicle_type) is None:
        raise InputError(
            f"{mission_file}: vehicleType {file.vehicle_type} (a MAV_TYPE) is not supported; "
            f"--type {' or --type '.join(kinds())} says as which the mission is to be judged"
        )
    if given is not None:
        theirs = autopilot_of(given)
    else:
        beside = {a: parameter_path(mission_file, a) for a in autopilots()}
        found = [a for a, path in beside.items() if path.is_file()]
        if len(found) > 1 and autopilot is None:
            raise InputError(
                f"{' and '.join(str(beside[a]) for a in found)}: only one of them can belong to "
                f"{mission_file}: remove the other, or give --autopilot"
            )
        theirs = found[0] if len(found) == 1 else None
    return None if theirs is None else (Vehicle(theirs), "as its parameters say")
