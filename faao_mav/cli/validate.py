"""`faao-mission validate MISSION`: whether it will be accepted, can be flown, delivers the link."""

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from faao_mav.cli.outcome import exit_status
from faao_mav.errors import InputError

if TYPE_CHECKING:
    from faao_mav.cli.findings import Verdict
    from faao_mav.mission.item import Mission
    from faao_mav.optimizer.solution import Solution
    from faao_mav.plan import Plan
    from faao_mav.plan.autopilots import Autopilot, Kind


def validate(
    mission_file: Annotated[
        Path | None, typer.Argument(metavar="MISSION", help="The mission: .waypoints or .plan.")
    ] = None,
    plan_file: Annotated[
        Path | None,
        typer.Option(
            "--plan",
            metavar="PLAN.yaml",
            help="The plan: its vehicle, its limits, and the link that it is to deliver.",
        ),
    ] = None,
    solution_file: Annotated[
        Path | None,
        typer.Option(
            "--solution",
            metavar="RESULT.npz",
            help="Instead of --plan: what --save wrote, with the plan in it, already solved.",
        ),
    ] = None,
    autopilot: Annotated[
        Literal["ardupilot", "px4"] | None, typer.Option(help="Whose mission it is.")
    ] = None,
    kind: Annotated[
        Literal["copter", "plane"] | None, typer.Option("--type", help="What flies it.")
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.param",
            help="The vehicle's parameters; without: those of the file of parameters beside "
            "MISSION, if there is one.",
        ),
    ] = None,
    max_duration: Annotated[
        float | None, typer.Option(metavar="S", help="The longest flight, seconds.")
    ] = None,
    max_distance: Annotated[
        float | None, typer.Option(metavar="M", help="The farthest from home, metres.")
    ] = None,
    max_altitude: Annotated[
        float | None, typer.Option(metavar="M", help="The highest above home, metres.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="PAGE.html", help="One page with map and findings."),
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings fail as well.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the text.")
    ] = False,
    rules: Annotated[bool, typer.Option("--rules", help="List the rules and stop.")] = False,
) -> None:
    """Check a mission before anyone walks to the field.

    Says whether the autopilot will take it, whether the aircraft can fly it as it is written,
    how near it comes to the fence, and with a plan what of its link the flight delivers, by its
    prediction. Item numbers are those of the file's rows, where row 0
    is home, and of QGroundControl.

    Exit status: 0 nothing is wrong; 1 errors, with --strict also warnings; 2 unusable arguments
    or a file that cannot be read.
    """
    with exit_status():
        from faao_mav.validate.finding import Level

        if rules:
            _list_rules(as_json)
            return
        if mission_file is None:
            raise InputError("MISSION: give a .waypoints or .plan file, or --rules")
        if plan_file is not None and solution_file is not None:
            raise InputError("--plan and --solution: give one; the solution has its plan in it")
        if report is not None:
            _check_report(report, mission_file, plan_file, solution_file)
        verdict, mission, solution = _judge(
            mission_file,
            (plan_file, solution_file),
            (autopilot, kind, parameters),
            (max_duration, max_distance, max_altitude),
        )
        if report is not None:
            _write_report(report, verdict, mission, solution)
        _show(verdict, as_json)
        if verdict.check.of(Level.ERROR) or (strict and verdict.check.of(Level.WARNING)):
            raise typer.Exit(1)


def _list_rules(as_json: bool) -> None:
    from rich.console import Console

    from faao_mav.cli.findings import rules_as_dict, show_rules
    from faao_mav.validate import RULES

    if as_json:
        typer.echo(json.dumps(rules_as_dict(RULES)))
    else:
        show_rules(RULES, Console())


def _judge(
    mission_file: Path,
    plans: tuple[Path | None, Path | None],
    asked: "tuple[Autopilot | None, Kind | None, Path | None]",
    given: tuple[float | None, float | None, float | None],
) -> "tuple[Verdict, Mission, Solution | None]":
    from faao_mav.cli.findings import Verdict
    from faao_mav.cli.vehicle import choose_vehicle
    from faao_mav.mission.formats import read_mission_file
    from faao_mav.validate import Limits
    from faao_mav.validate.check import check
    from faao_mav.vehicle import flight_model, modelled

    for option, value in zip(("duration", "distance", "altitude"), given, strict=True):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"--max-{option} {value:g}: expected a number above 0")
    plan, solution = _planned(*plans)
    max_duration, max_distance, max_altitude = given
    limits = Limits(
        max_duration,
        max_distance,
        max_altitude,
        max_speed=plan.vehicle.max_speed if plan else None,
    )
    file = read_mission_file(mission_file)
    vehicle, chosen_by = choose_vehicle(mission_file, file, plan, asked)
    if modelled(vehicle):
        flight_model(vehicle)  # a useless parameter is refused, not left out of the judgement
    found = check(file.mission, vehicle, limits=limits, solution=solution)
    verdict = Verdict(mission_file, len(file.mission.items), vehicle, chosen_by, found)
    return verdict, file.mission, solution


def _check_report(
    report: Path, mission_file: Path, plan_file: Path | None, solution_file: Path | None
) -> None:
    """Refuse a page that cannot be written before the work, and one over an input."""
    from faao_mav.cli.report import check_names
    from faao_mav.files import check_apart, check_writable

    check_names(report, None)
    check_writable(report)
    read = {"MISSION": mission_file, "--plan": plan_file, "--solution": solution_file}
    check_apart({"--report": report}, read)


def _write_report(
    report: Path, verdict: "Verdict", mission: "Mission", solution: "Solution | None"
) -> None:
    from faao_mav.files import write_whole
    from faao_mav.report import ReportData, render_report

    found = verdict.check
    page = render_report(
        ReportData(
            solution=solution,
            findings=found.findings,
            mission=mission,
            track=found.track,
            link=found.link,
            vehicle=verdict.vehicle,
            title=verdict.source.name,
        )
    )
    write_whole(report, page.encode())


def _show(verdict: "Verdict", as_json: bool) -> None:
    from rich.console import Console

    from faao_mav.cli.findings import as_dict, show

    if as_json:
        typer.echo(json.dumps(as_dict(verdict), allow_nan=False))
    else:
        show(verdict, Console())


def _planned(
    plan_file: Path | None, solution_file: Path | None
) -> "tuple[Plan | None, Solution | None]":
    """Return the plan and what its flight is to be; a plan alone is solved for that."""
    if solution_file is not None:
        from faao_mav.optimizer.solution import load_solution

        solution = load_solution(solution_file)
        return solution.plan, solution
    if plan_file is None:
        return None, None
    from faao_mav.cli.progress import progress
    from faao_mav.optimizer.optimize import optimize
    from faao_mav.plan import read_plan

    plan = read_plan(plan_file)
    with progress(shown=sys.stderr.isatty()) as observe:
        return plan, optimize(plan, observe=observe)
