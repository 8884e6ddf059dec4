"""`faao-mission validate` and `convert`: a mission file, judged, and in another format."""

import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import faao_mav.cli.shared as cli
from faao_mav.errors import InputError, counted, printable
from faao_mav.files import write_whole

if TYPE_CHECKING:
    from faao_mav.autopilot import Vehicle
    from faao_mav.mission.formats import MissionFile
    from faao_mav.plan import Plan
    from faao_mav.validate import Check, Level, Rule


def validate(
    mission_file: cli.File = typer.Argument(
        None, metavar="MISSION", help="The mission: .waypoints or .plan."
    ),
    plan_file: cli.File = cli.PLAN_FILE,
    solution_file: cli.File = cli.SOLUTION_FILE,
    autopilot: str | None = cli.AUTOPILOT,
    kind: str | None = cli.option("NAME", "What flies it: copter or plane.", "--type"),
    parameters: cli.File = cli.option(
        "FILE.param",
        "The vehicle's parameters; without: those of the file of parameters beside MISSION, "
        "if there is one.",
    ),
    max_duration: float | None = cli.option("S", "The longest flight, seconds."),
    max_distance: float | None = cli.option("M", "The farthest from home, metres."),
    max_altitude: float | None = cli.option("M", "The highest above home, metres."),
    wind: str | None = cli.option(
        "SPEED,FROM",
        "The wind to predict the flight in, m/s and degrees clockwise from north that it comes "
        "from; without: the plan's.",
    ),
    report: cli.File = cli.option("PAGE.html", "One page with map and findings."),
    strict: bool = cli.flag("--strict", "Warnings fail as well."),
    as_json: bool = cli.AS_JSON,
    rules: bool = cli.flag("--rules", "List the rules and stop."),
) -> None:
    """Check a mission before anyone walks to the field.

    Says whether the autopilot will take it, whether the aircraft can fly it as it is written,
    how near it comes to the fence, and with a plan what of its link the flight delivers, by its
    prediction. Item numbers are those of the file's rows, where row 0
    is home, and of QGroundControl.

    Exit status: 0 nothing is wrong; 1 errors, with --strict also warnings; 2 unusable arguments
    or a file that cannot be read.
    """
    from faao_mav.validate import RULES, Level, Limits, check

    if rules:
        cli.show(lambda: _rules_as_dict(RULES), lambda: _rule_lines(RULES), as_json=as_json)
        return
    if mission_file is None:
        raise InputError("MISSION: give a .waypoints or .plan file, or --rules")
    cli.check_known(autopilot, kind)
    most = {"duration": max_duration, "distance": max_distance, "altitude": max_altitude}
    for name, value in most.items():
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"--max-{name} {value:g}: expected a number above 0")
    air = cli.read_wind(wind)
    inputs = {"MISSION": mission_file, "--plan": plan_file, "--solution": solution_file}
    cli.check_outputs({"--report": report}, inputs)
    solution = cli.planned(plan_file, solution_file)
    plan = solution.plan if solution is not None else None
    file = cli.read_noted(mission_file)
    vehicle, chosen_by = choose_vehicle(mission_file, file, plan, autopilot, kind, parameters)
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
    cli.show(
        lambda: {"mission": mission_file, **_as_dict(found)},
        lambda: _lines(f"{mission_file}", chosen_by, found),
        as_json=as_json,
        good=not found.of(Level.ERROR) and not (strict and found.of(Level.WARNING)),
    )


def convert(
    mission_file: Path = typer.Argument(
        metavar="MISSION", help="The mission: .waypoints, .txt or .plan."
    ),
    out: Path = cli.option("OTHER", "What to write: .waypoints, .txt, .plan or .kml.", default=...),
    autopilot: str | None = cli.AUTOPILOT,
    as_json: bool = cli.AS_JSON,
) -> None:
    """Write a mission in another format, and say what that cannot hold.

    The fence of a .waypoints or .txt file is a second file, M.fence.waypoints of M.waypoints.

    Without --autopilot a .plan is for whom the mission that is read, or the parameters beside it,
    say it is for.

    Exit status: 0 done; 2 unusable arguments or input.
    """
    from faao_mav.autopilot import Vehicle, kind_by_number
    from faao_mav.autopilot.files import made_for, plan_target
    from faao_mav.mission.formats import check_suffix

    cli.check_known(autopilot, None)
    check_suffix(out)
    cli.check_outputs({"--out": out}, {"MISSION": mission_file})
    read = cli.read_noted(mission_file)
    kind = kind_by_number(read.vehicle_type) or "copter"
    whose = autopilot or made_for(mission_file, read).autopilot
    vehicle = Vehicle(whose, kind) if whose is not None else None
    written = cli.write_noted(read.mission, out, plan_target(vehicle))
    items, names = len(read.mission.items), " and ".join(map(str, written.contents))
    cli.show(
        lambda: {"items": items, "lost": written.lost, "written": out},
        lambda: [f"{counted(items, 'item')} written to {names}"],
        as_json=as_json,
    )


def choose_vehicle(
    mission_file: Path,
    file: "MissionFile",
    plan: "Plan | None",
    autopilot: str | None = None,
    kind: str | None = None,
    parameters: Path | None = None,
) -> "tuple[Vehicle, str]":
    """Return the vehicle that flies a mission, and what told which.

    What --autopilot, --type and --parameters leave open the plan says, else the
    mission's file, else the names of the parameters. The parameters are those asked for, else
    those beside the mission, over the plan's own. Raises `InputError` for parameters of another
    autopilot than the mission's, for files of several autopilots beside a mission that does not
    say whose it is, and for a mission of a type of vehicle that is unknown here.
    """
    from faao_mav.autopilot import Vehicle, autopilots, families, kinds
    from faao_mav.autopilot.files import MadeFor, autopilot_of, made_for, parameter_path
    from faao_mav.mission.formats.parameter_file import read_parameters

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


_COLOURS = {"error": "red", "warning": "yellow", "note": "cyan"}
"""How a terminal shows each level of a finding."""


def _as_dict(check: "Check") -> dict[str, Any]:
    """Return the JSON object of `--json`; seconds, metres, bit/s/Hz."""
    from faao_mav.validate import Level

    vehicle, link = check.vehicle, check.link
    predicted = None
    if check.track is not None:
        predicted = {"duration": float(check.track.t[-1]), "assumption": vehicle.assumption}
    more = {} if link is None else {n: getattr(link, n) for n in ("share", "predicted_mbytes")}
    return {
        "items": len(check.mission.items),
        "autopilot": vehicle.autopilot,
        "type": vehicle.kind,
        "parameters": vehicle.source if vehicle.parameters else None,
        "predicted": predicted,
        "link": cli.plain(link) | more if link is not None else None,
        "energy": check.energy.as_dict() if check.energy else None,
        **{f"{level}s": len(check.of(level)) for level in Level},
        "findings": check.findings,
    }


def _lines(source: str, chosen_by: str, check: "Check") -> Iterator[str]:
    """Yield what was found: one line a rule, and one of what to do."""
    from faao_mav.report.summary import check_lines
    from faao_mav.validate import Level
    from faao_mav.validate.rule import by_rule, count_of, said_of

    vehicle = check.vehicle
    yield (
        f"{source}: {counted(len(check.mission.items), 'item')}, for "
        f"{vehicle.type.family.name} and a {vehicle.kind} ({chosen_by}); "
        f"parameters: {vehicle.source if vehicle.parameters else 'defaults'}"
    )
    for label, text in check_lines(check):
        if label:  # what goes on without one stands in the findings too
            yield f"{label}: {text}"
    for group in by_rule(check.findings):
        yield f"{_coloured(group[0].level)}: {said_of(group)}"
        if group[0].action:
            yield f"    to do: {group[0].action}"
    yield ", ".join(count_of(check.findings, level) for level in Level)


def _rules_as_dict(rules: "Sequence[Rule]") -> dict[str, Any]:
    """Return the JSON object of `--rules --json`; null: every autopilot, every type."""
    keys = {"id": "id", "level": "level", "autopilot": "autopilot", "type": "kind"}
    keys |= {"summary": "summary", "source": "source"}
    return {"rules": [{key: getattr(r, name) or None for key, name in keys.items()} for r in rules]}


def _rule_lines(rules: "Sequence[Rule]") -> Iterator[str]:
    """Yield a line a rule, its parts between tabs."""
    for rule in rules:
        whose = " ".join(filter(None, (rule.autopilot, rule.kind))) or "all"
        yield "\t".join((_coloured(rule.level), rule.id, whose, rule.summary, rule.source))


def _coloured(level: "Level") -> str:
    return typer.style(str(level), fg=_COLOURS[str(level)]) if sys.stdout.isatty() else str(level)
