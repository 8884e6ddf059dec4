"""`faao-mission validate MISSION`: whether it will be accepted, can be flown, delivers the link."""

import math
from typing import Annotated

import typer

from faao_mav.cli.planned import PlanFile, SolutionFile, planned
from faao_mav.cli.shared import (
    Aircraft,
    AsJson,
    File,
    Number,
    Whose,
    check_known,
    check_page,
    exit_status,
    flag,
    option,
    read_noted,
    read_wind,
    show,
)
from faao_mav.errors import InputError, printable
from faao_mav.files import write_whole


@exit_status()
def validate(
    mission_file: Annotated[
        File, typer.Argument(metavar="MISSION", help="The mission: .waypoints or .plan.")
    ] = None,
    plan_file: PlanFile = None,
    solution_file: SolutionFile = None,
    autopilot: Whose = None,
    kind: Aircraft = None,
    parameters: Annotated[
        File,
        option(
            "FILE.param",
            "The vehicle's parameters; without: those of the file of parameters beside MISSION, "
            "if there is one.",
        ),
    ] = None,
    max_duration: Annotated[Number, option("S", "The longest flight, seconds.")] = None,
    max_distance: Annotated[Number, option("M", "The farthest from home, metres.")] = None,
    max_altitude: Annotated[Number, option("M", "The highest above home, metres.")] = None,
    wind: Annotated[
        str | None,
        option(
            "SPEED,FROM",
            "The wind to predict the flight in, m/s and degrees clockwise from north that it comes "
            "from; without: the plan's.",
        ),
    ] = None,
    report: Annotated[File, option("PAGE.html", "One page with map and findings.")] = None,
    strict: Annotated[bool, flag("--strict", "Warnings fail as well.")] = False,
    as_json: AsJson = False,
    rules: Annotated[bool, flag("--rules", "List the rules and stop.")] = False,
) -> None:
    """Check a mission before anyone walks to the field.

    Says whether the autopilot will take it, whether the aircraft can fly it as it is written,
    how near it comes to the fence, and with a plan what of its link the flight delivers, by its
    prediction. Item numbers are those of the file's rows, where row 0
    is home, and of QGroundControl.

    Exit status: 0 nothing is wrong; 1 errors, with --strict also warnings; 2 unusable arguments
    or a file that cannot be read.
    """
    from faao_mav.cli.findings import CheckedFile, rule_lines, rules_as_dict
    from faao_mav.cli.vehicle import choose_vehicle
    from faao_mav.validate import RULES, Level, Limits
    from faao_mav.validate.check import check

    if rules:
        show(lambda: rules_as_dict(RULES), lambda: rule_lines(RULES), as_json=as_json)
        return
    if mission_file is None:
        raise InputError("MISSION: give a .waypoints or .plan file, or --rules")
    check_known(autopilot, kind)
    most = {"duration": max_duration, "distance": max_distance, "altitude": max_altitude}
    for name, value in most.items():
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"--max-{name} {value:g}: expected a number above 0")
    air = read_wind(wind)
    check_page(report, {"MISSION": mission_file, "--plan": plan_file, "--solution": solution_file})
    solution = planned(plan_file, solution_file)
    plan = solution.plan if solution is not None else None
    file = read_noted(mission_file)
    vehicle, chosen_by = choose_vehicle(mission_file, file, plan, (autopilot, kind, parameters))
    if vehicle.type.flight_model is not None:
        vehicle.flight_model()  # a useless parameter is refused, not left out of the judgement
    max_speed = plan.vehicle.max_speed if plan is not None else None
    limits = Limits(max_duration, max_distance, max_altitude, max_speed)
    found = check(file.mission, vehicle, limits=limits, solution=solution, wind=air)
    if report is not None:
        from faao_mav.report.page import render_report
        from faao_mav.workflow import Result

        about = Result(solution, check=found) if solution is not None else found
        page = render_report(about, title=printable(mission_file.name))
        write_whole(report, page.encode())
    checked = CheckedFile(mission_file, chosen_by, found)
    show(checked.as_dict, checked.lines, as_json=as_json)
    if found.of(Level.ERROR) or (strict and found.of(Level.WARNING)):
        raise typer.Exit(1)
