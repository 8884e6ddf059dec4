"""Who flies a mission file: what tells, and in which order it is believed."""

from pathlib import Path
from typing import TYPE_CHECKING

from faao_mav.autopilot import Vehicle, autopilots, families, kinds
from faao_mav.autopilot.files import MadeFor, autopilot_of, made_for, parameter_path
from faao_mav.errors import InputError
from faao_mav.mission.formats.parameter_file import read_parameters

if TYPE_CHECKING:
    from faao_mav.mission.formats import MissionFile
    from faao_mav.plan import Plan


def choose_vehicle(
    mission_file: Path,
    file: "MissionFile",
    plan: "Plan | None",
    asked: tuple[str | None, str | None, Path | None],
) -> tuple[Vehicle, str]:
    """Return the vehicle, and what told which.

    `asked` are --autopilot, --type and --parameters. What they leave open the plan says, else the
    mission's file, else the names of the parameters. The parameters are those asked for, else
    those beside the mission, over the plan's own. Raises `InputError` for parameters of another
    autopilot than the mission's, for files of several autopilots beside a mission that does not
    say whose it is, and for a mission of a type of vehicle that is unknown here.
    """
    autopilot, kind, parameters = asked
    planned = plan.aircraft if plan is not None else None
    told = made_for(mission_file, file, planned)
    given = read_parameters(parameters) if parameters is not None else None
    if kind is None and told.kind is not None and told.kind not in kinds():
        raise InputError(
            f"{mission_file}: vehicleType {file.vehicle_type} (a MAV_TYPE) is not supported; "
            f"--type {' or --type '.join(kinds())} says as which the mission is to be judged"
        )
    theirs = autopilot_of(given or ())
    if planned is None and theirs is not None and (file.firmware is None or not told.autopilot):
        told = MadeFor(theirs, told.kind, "as its parameters say")
    whose, by = autopilot or told.autopilot, told.by
    if whose is None:
        found = {each: parameter_path(mission_file, each) for each in autopilots()}
        beside = [each for each, path in found.items() if given is None and path.is_file()]
        if len(beside) > 1:
            raise InputError(
                f"{' and '.join(str(found[each]) for each in beside)}: only one of them can belong "
                f"to {mission_file}: remove the other, or give --autopilot"
            )
        whose, by = Vehicle().autopilot, "by default; --autopilot and --type say otherwise"
        if beside:
            whose, by = beside[0], f"as {found[beside[0]].name} beside it says"
    if autopilot is not None or kind is not None:
        by = "as asked"
    base = planned if planned is not None and planned.autopilot == whose else Vehicle(whose)
    values, source = base.parameters, base.source
    if given is not None:
        values, source = given, str(parameters)
    elif (parameters := parameter_path(mission_file, whose)).is_file():
        given = read_parameters(parameters)
        values, source = {**values, **given}, f"{parameters}, beside the mission"
        theirs = autopilot_of(given)
    if theirs not in (None, whose):
        raise InputError(
            f"{parameters}: parameters of {families()[theirs].name}, but the mission is for "
            f"{families()[whose].name} ({by}): give the vehicle's own (--parameters), or "
            f"--autopilot {theirs}"
        )
    kind = kind or told.kind or base.kind
    return Vehicle(whose, kind, values, source, base.body if kind == base.kind else None), by
