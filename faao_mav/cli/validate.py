"""`faao-mission validate MISSION`: whether it will be accepted, can be flown, delivers the link."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from faao_mav.cli.planned import PlanFile, SolutionFile, check_one, planned
from faao_mav.cli.shared import (
    Aircraft,
    AsJson,
    File,
    Number,
    Whose,
    check_known,
    exit_status,
    flag,
    note,
    option,
    read_wind,
)
from faao_mav.errors import InputError, printable
from faao_mav.files import PAGES, check_apart, check_ending, check_writable, write_whole

if TYPE_CHECKING:
    from faao_mav.autopilot import Autopilot, Kind
    from faao_mav.cli.findings import CheckedFile
    from faao_mav.optimizer.solution import Solution
    from faao_mav.plan import Vector


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
    from faao_mav.validate import Level

    if rules:
        _list_rules(as_json)
        return
    if mission_file is None:
        raise InputError("MISSION: give a .waypoints or .plan file, or --rules")
    check_one(plan_file, solution_file)
    check_known(autopilot, kind)
    _check_options((max_duration, max_distance, max_altitude), report)
    air = read_wind(wind)
    read = {"MISSION": mission_file, "--plan": plan_file, "--solution": solution_file}
    check_apart({"--report": report}, read)
    solution = planned(plan_file, solution_file)
    limits = (max_duration, max_distance, max_altitude)
    checked = _judge(mission_file, solution, (autopilot, kind, parameters), limits, air)
    if report is not None:
        _write_report(report, checked, solution)
    _show(checked, as_json)
    if checked.check.of(Level.ERROR) or (strict and checked.check.of(Level.WARNING)):
        raise typer.Exit(1)


def _list_rules(as_json: bool) -> None:
    from rich.console import Console

    from faao_mav.cli.findings import rules_as_dict, show_rules
    from faao_mav.validate import RULES

    if as_json:
        typer.echo(json.dumps(rules_as_dict(RULES)))
    else:
        show_rules(RULES, Console())


def _check_options(
    limits: "tuple[float | None, float | None, float | None]", report: Path | None
) -> None:
    """Refuse limits that are none, and a page that cannot be written, before the work."""
    for name, value in zip(("duration", "distance", "altitude"), limits, strict=True):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"--max-{name} {value:g}: expected a number above 0")
    if report is not None:
        check_ending(report, "--report", PAGES)
        check_writable(report)


def _judge(
    mission_file: Path,
    solution: "Solution | None",
    asked: "tuple[Autopilot | None, Kind | None, Path | None]",
    given: tuple[float | None, float | None, float | None],
    wind: "Vector | None",
) -> "CheckedFile":
    from faao_mav.cli.findings import CheckedFile
    from faao_mav.cli.vehicle import choose_vehicle
    from faao_mav.mission.formats import read_mission_file
    from faao_mav.validate import Limits
    from faao_mav.validate.check import check

    plan = solution.plan if solution is not None else None
    limits = Limits(*given, max_speed=plan.vehicle.max_speed if plan is not None else None)
    file = read_mission_file(mission_file)
    for line in file.warnings:
        note(line)
    vehicle, chosen_by = choose_vehicle(mission_file, file, plan, asked)
    if vehicle.type.flight_model is not None:
        vehicle.flight_model()  # a useless parameter is refused, not left out of the judgement
    found = check(file.mission, vehicle, limits=limits, solution=solution, wind=wind)
    return CheckedFile(mission_file, chosen_by, found)


def _write_report(report: Path, checked: "CheckedFile", solution: "Solution | None") -> None:
    from faao_mav.report.page import render_report
    from faao_mav.workflow import Result

    about = Result(solution, check=checked.check) if solution is not None else checked.check
    write_whole(report, render_report(about, title=printable(checked.source.name)).encode())


def _show(checked: "CheckedFile", as_json: bool) -> None:
    from rich.console import Console

    from faao_mav.cli.findings import as_dict, show

    if as_json:
        typer.echo(json.dumps(as_dict(checked), allow_nan=False))
    else:
        show(checked, Console())
