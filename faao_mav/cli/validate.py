"""`faao-mission validate MISSION`: whether it will be accepted, can be flown, delivers the link."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from faao_mav.cli.outcome import exit_status
from faao_mav.errors import FaaoError, InputError

if TYPE_CHECKING:
    from faao_mav.mission.flight.track import Track
    from faao_mav.mission.formats import MissionFile
    from faao_mav.mission.item import Mission
    from faao_mav.mission.vehicle import Vehicle
    from faao_mav.plan import Plan


def validate(
    mission_file: Annotated[
        Path | None, typer.Argument(metavar="MISSION", help="The mission: .waypoints or .plan.")
    ] = None,
    plan_file: Annotated[
        Path | None,
        typer.Option("--plan", metavar="PLAN.yaml", help="The plan: its vehicle and its limits."),
    ] = None,
    autopilot: Annotated[str | None, typer.Option(metavar="A", help="ardupilot or px4.")] = None,
    kind: Annotated[
        str | None, typer.Option("--type", metavar="T", help="copter or plane.")
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option(metavar="FILE.param", help="The vehicle's parameters; without: defaults."),
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
    strict: Annotated[bool, typer.Option("--strict", help="Warnings fail as well.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the text.")
    ] = False,
    rules: Annotated[bool, typer.Option("--rules", help="List the rules and stop.")] = False,
) -> None:
    """Check a mission before anyone walks to the field.

    Says whether the autopilot will take it, whether the aircraft can fly it as it is written,
    and how near it comes to the fence. Item numbers are those of the file's rows, where row 0
    is home, and of QGroundControl.

    Exit status: 0 nothing is wrong; 1 errors, with --strict also warnings; 2 unusable arguments
    or a file that cannot be read.
    """
    with exit_status():
        if rules:
            _list_rules(as_json)
            return
        if mission_file is None:
            raise InputError("MISSION: give a .waypoints or .plan file, or --rules")
        limits = (max_duration, max_distance, max_altitude)
        failed = _run(mission_file, plan_file, autopilot, kind, parameters, limits, strict, as_json)
        if failed:
            raise typer.Exit(1)


def _list_rules(as_json: bool) -> None:
    from rich.console import Console

    from faao_mav.cli.findings import rules_as_dict, show_rules
    from faao_mav.mission.validate import RULES

    if as_json:
        typer.echo(json.dumps(rules_as_dict(RULES)))
    else:
        show_rules(RULES, Console())


def _run(
    mission_file: Path,
    plan_file: Path | None,
    autopilot: str | None,
    kind: str | None,
    parameters: Path | None,
    given: tuple[float | None, float | None, float | None],
    strict: bool,
    as_json: bool,
) -> bool:
    from rich.console import Console

    from faao_mav.cli.findings import Verdict, as_dict, show
    from faao_mav.mission.formats import read_mission_file
    from faao_mav.mission.validate import Level, Limits, validate
    from faao_mav.plan import read_plan

    plan = read_plan(plan_file) if plan_file is not None else None
    max_duration, max_distance, max_altitude = given
    limits = Limits(
        max_duration,
        max_distance,
        max_altitude,
        max_speed=plan.vehicle.max_speed if plan else None,
    )
    file = read_mission_file(mission_file)
    vehicle, chosen_by = _vehicle(file, plan, autopilot, kind, parameters)
    track, unpredicted = _track(file.mission, vehicle)
    findings = validate(file.mission, vehicle, track=track, limits=limits)
    verdict = Verdict(
        mission_file, len(file.mission.items), vehicle, chosen_by, track, unpredicted, findings
    )
    if as_json:
        typer.echo(json.dumps(as_dict(verdict), allow_nan=False))
    else:
        show(verdict, Console())
    return bool(verdict.count(Level.ERROR) or (strict and verdict.count(Level.WARNING)))


def _vehicle(
    file: "MissionFile",
    plan: "Plan | None",
    autopilot: str | None,
    kind: str | None,
    parameters: Path | None,
) -> tuple["Vehicle", str]:
    """Return the vehicle, and what told which: arguments, then the plan, then the mission."""
    from faao_mav.mission.parameter_file import read_parameters
    from faao_mav.mission.vehicle import Autopilot, Kind, Vehicle, vehicle_of

    base, chosen_by = Vehicle(), "by default; --autopilot and --type say otherwise"
    if file.autopilot is not None:
        base, chosen_by = Vehicle(file.autopilot, file.kind or "copter"), "as the file says"
    if plan is not None:
        base, chosen_by = vehicle_of(plan), "as the plan says"
    if autopilot is not None or kind is not None:
        chosen_by = "as asked"
    for name, value, known in (
        ("--autopilot", autopilot, get_args(Autopilot)),
        ("--type", kind, get_args(Kind)),
    ):
        if value is not None and value not in known:
            raise InputError(f"{name} {value}: expected {' or '.join(known)}")
    values, source = base.parameters, base.source
    if autopilot is not None and autopilot != base.autopilot:
        values = {}  # of another autopilot
    if parameters is not None:
        values, source = read_parameters(parameters), str(parameters)
    vehicle = Vehicle(
        autopilot or base.autopilot,  # type: ignore[arg-type]  # checked above
        kind or base.kind,  # type: ignore[arg-type]
        values,
        source,
    )
    return vehicle, chosen_by


def _track(mission: "Mission", vehicle: "Vehicle") -> tuple["Track | None", str]:
    """Return the predicted flight, or None and why there is none."""
    from faao_mav.mission.flight.predict import predict

    try:
        track = predict(mission, vehicle)
    except FaaoError as error:
        return None, str(error)
    return (track, "") if len(track.t) else (None, "there is nothing to fly")
