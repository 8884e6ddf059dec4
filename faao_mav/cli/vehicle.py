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
    if plan is not None:
        base, chosen_by = plan.aircraft, "as the plan says"
    elif (named := vehicle_in(file)) is not None:
        base, chosen_by = named, "as the file says"
    else:
        base, chosen_by = _by_parameters(mission_file, file, given, asked)
    if autopilot is not None or kind is not None:
        chosen_by = "as asked"
    whose = autopilot or base.autopilot
    values, source = base.parameters if whose == base.autopilot else {}, base.source
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


def _by_parameters(
    mission_file: Path,
    file: "MissionFile",
    given: dict[str, float] | None,
    asked: tuple[Autopilot | None, Kind | None, Path | None],
) -> tuple[Vehicle, str]:
    """Return the vehicle of the parameters `given` or beside the mission, and what told it."""
    autopilot, kind, _ = asked
    if file.vehicle_type and kind is None and kind_by_number(file.vehicle_type) is None:
        raise InputError(
            f"{mission_file}: vehicleType {file.vehicle_type} (a MAV_TYPE) is not supported; "
            f"--type {' or --type '.join(kinds())} says as which the mission is to be judged"
        )
    beside = {each: parameter_path(mission_file, each) for each in autopilots()}
    found = [each for each, path in beside.items() if path.is_file()]
    if given is None and len(found) > 1 and autopilot is None:
        raise InputError(
            f"{' and '.join(str(beside[each]) for each in found)}: only one of them can belong to "
            f"{mission_file}: remove the other, or give --autopilot"
        )
    theirs = autopilot_of(given) if given is not None else found[0] if len(found) == 1 else None
    if theirs is not None:
        return Vehicle(theirs), "as its parameters say"
    return Vehicle(), "by default; --autopilot and --type say otherwise"
