"""`faao-mission upload`, `download`, `fly`, `debrief`: what is done with a vehicle and its log."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import faao_mav.cli.shared as cli
from faao_mav.cli.missions import choose_vehicle
from faao_mav.errors import InputError, counted
from faao_mav.files import write_whole

if TYPE_CHECKING:
    from faao_mav.mission.item import Mission
    from faao_mav.wire.jobs import UploadReport


@cli.with_link
def upload(
    mission_file: Path = typer.Argument(metavar="MISSION", help="The mission file."),
    to: str = cli.option("CONNECTION", cli.VEHICLE, default=...),
    parameters: cli.File = cli.option(
        "FILE", "Set the parameters that MISSION is timed for, first, and read them back."
    ),
    clear_rest: bool = cli.flag(
        "--clear-rest", "Clear a fence and rally points that MISSION does not have."
    ),
    as_json: bool = cli.AS_JSON,
    allow_armed: bool = cli.ALLOW_ARMED,
    *,
    link: dict[str, Any],
) -> None:
    """Upload a mission, read it back and compare.

    It says how far the vehicle stands from the mission's home, and how much higher or lower. A
    mission for another autopilot or type of vehicle is not uploaded. --parameters sets what shapes
    how a mission is flown, and nothing that decides about failsafes, fence, return or checks.

    Exit status: 0 it is on the vehicle, whole and equal; 1 it is not, or that is not known; 2
    unusable arguments or input.
    """
    from faao_mav.autopilot.files import made_for
    from faao_mav.mission.formats.parameter_file import read_parameters
    from faao_mav.wire.parameters import check_settable

    file = cli.read_noted(mission_file)
    values = None if parameters is None else read_parameters(parameters)
    check_settable(values or {}, parameters)
    report = send(
        file.mission,
        to,
        quiet=as_json,
        allow_armed=allow_armed,
        made_for=made_for(mission_file, file),
        parameters=values,
        clear_rest=clear_rest,
        **link,
    )
    told = (lambda: as_dict(report)), (lambda: [str(report)])
    cli.show(*told, as_json=as_json, good=report.verified)


def send(mission: "Mission", to: str, *, quiet: bool, **options: Any) -> "UploadReport":
    """Upload a mission and verify it, with progress unless `quiet`; see `upload` there."""
    from faao_mav.wire.client import upload as run

    with cli.progress(quiet=quiet) as observe:
        report = run(mission, to, observe=observe, **options)
    if not report.verified:
        cli.note("the mission is not verified; do not fly it")
    return report


def as_dict(report: "UploadReport") -> dict[str, Any]:
    """Return `report` as JSON takes it."""
    vehicle, stands = report.vehicle, report.stands
    but = {"part": True, "said": True, "differences": {"__all__": {"part"}}}
    return {
        "verified": report.verified,
        "vehicle": {
            "system": vehicle.address.system,
            "component": vehicle.address.component,
            "autopilot": vehicle.autopilot,
            "type": vehicle.kind,
        },
        "stands": stands and cli.plain(stands) | {"is_meant": stands.is_meant},
        "parameters": cli.plain(report.changes),
        "seconds": round(report.seconds, 3),
        "problems": list(report.problems),
        "lists": [
            {"list": part.part.name.lower(), **cli.plain(part, exclude=but)}
            for part in report.parts
        ],
    }


@cli.with_link
def download(
    source: str = cli.option("CONNECTION", cli.VEHICLE, "--from", default=...),
    out: Path = cli.option("MISSION", "Write the mission.", default=...),
    *,
    link: dict[str, Any],
) -> None:
    """Download the mission, fence and rally points of a vehicle.

    A fence or rally points that do not come are told, and the rest is written.

    Exit status: 0 done; 1 there is no such vehicle, or a list did not come whole; 2 unusable
    arguments.
    """
    from faao_mav.autopilot import Vehicle
    from faao_mav.autopilot.files import plan_target
    from faao_mav.mission.formats import check_suffix
    from faao_mav.wire.client import holdings

    check_suffix(out)
    cli.check_outputs({"--out": out}, {})
    with cli.progress() as observe:
        held = holdings(source, observe=observe, **link)
    found, mission = held.vehicle, held.mission
    target = plan_target(Vehicle(found.autopilot, found.kind)) if found.vehicle else None
    written = cli.write_noted(mission, out, target)
    told = {
        "fence": counted(len(mission.fence.areas), "fence area"),
        "rally points": counted(len(mission.rally), "rally point"),
    }
    told |= {part: f"{part} not read" for part in mission.unread}
    typer.echo(f"vehicle      {found}")
    typer.echo(f"mission      {counted(len(mission.items), 'item')}, {', '.join(told.values())}")
    for path in written.contents:
        typer.echo(f"written      {path}")
    for problem in held.problems:
        cli.note(problem)
    if held.problems:
        raise typer.Exit(1)


@cli.with_link
def fly(
    mission_file: Path = typer.Argument(metavar="MISSION", help="The mission file."),
    to: str = cli.option("CONNECTION", cli.VEHICLE, default=...),
    plan_file: cli.File = cli.PLAN_FILE,
    solution_file: cli.File = cli.SOLUTION_FILE,
    arm: bool = cli.flag("--arm", "Arm the vehicle and start the mission."),
    stream: bool = cli.flag(
        "--stream", "Fly the plan by setpoints instead of the mission; needs --arm."
    ),
    rate: float = cli.option("HZ", "Setpoints a second of --stream.", min=4, max=50, default=10.0),
    elsewhere: bool = cli.flag(
        "--elsewhere", "Arm it at another place, or height, than MISSION is made for."
    ),
    untimed: bool = cli.flag(
        "--untimed", "Arm it with other parameters than MISSION is timed for."
    ),
    radio: str | None = cli.option(
        "udp:HOST:PORT", "Tell radios the precoders of each slot, in JSON lines."
    ),
    as_json: bool = cli.flag("--json", "Print JSON objects, one a line."),
    *,
    link: dict[str, Any],
) -> None:
    """Watch a vehicle fly a mission that it holds, to the end.

    What the vehicle holds is compared with MISSION first. Then it says what stands against the
    flight: where the vehicle stands, what it holds beside MISSION, its parameters, its battery, its
    mode, what validation says with its own parameters; and what it does by itself on a loss. A line
    a second tells mode, item and battery; with a plan also how late the flight is, how far from
    plan and path (m), the rates of both hops, and what is delivered so far and by the end. It arms
    and starts only with --arm, once nothing stands against the flight, the autopilot's own checks
    pass and no other ground station is on the link. A pilot who changes
    the mode has the aircraft: nothing more is sent. With --stream a copter that holds the mission
    flies the trajectory of the plan by setpoints (GUIDED, Offboard), not the mission. Ctrl-C asks a
    flight that was started here to hold, a second one leaves it; in other flights the first one
    leaves.

    Exit status: 0 the mission was flown to its end; 1 it was not, or that is not known; 2 unusable
    arguments or input.
    """
    from faao_mav.autopilot.files import made_for
    from faao_mav.fly.fly import HEADER, Radios, Telling, as_text, fly_mission
    from faao_mav.fly.preflight import Flight
    from faao_mav.fly.telemetry import POSITION_RATE
    from faao_mav.report.debrief import flight_lines
    from faao_mav.report.summary import joined
    from faao_mav.validate import predicted
    from faao_mav.workflow import debriefing_as_dict

    header = [] if as_json else [HEADER]

    def say(told: dict[str, Any]) -> None:
        if header and "note" not in told:
            typer.echo(header.pop())
        typer.echo(json.dumps(cli.plain(told)) if as_json else as_text(told))

    if stream and not arm:
        raise InputError("--stream: needs --arm: it arms the vehicle, and flies it")
    for name, given in (("--stream", stream), ("--radio", radio)):
        if given and plan_file is None and solution_file is None:
            raise InputError(f"{name}: needs --plan or --solution: the flight that is planned")
    file = cli.read_noted(mission_file)
    solution = cli.planned(plan_file, solution_file)
    radios = Radios(solution, radio) if solution is not None and radio is not None else None
    plan = solution.plan if solution is not None else None
    vehicle, _ = choose_vehicle(mission_file, file, plan)
    whose = made_for(mission_file, file, plan.aircraft if plan is not None else None)
    track = None
    if not stream:
        rate, wind = POSITION_RATE, plan.wind if plan is not None else (0.0, 0.0)
        track, reason = predicted(file.mission, vehicle, wind)
        if track is None:
            cli.note(f"the flight is not predicted: {reason}")
    telling = Telling(solution, track, radios, say)
    if radios is not None and plan is not None:  # two positions for each slot at least
        rate = max(rate, 2 / plan.flight.time_step)
    report = fly_mission(
        Flight(file.mission, vehicle, whose, solution, stream),
        to,
        arm=arm,
        lands=track is None or track.lands,
        elsewhere=elsewhere,
        untimed=untimed,
        rate=rate,
        watching=telling,
        **link,
    )
    ending, found = report.ending, telling.debriefing(report)
    if ending is None and not as_json:
        cli.note("the vehicle holds another mission than the file: upload it first")
    cli.show(
        lambda: {
            "ending": ending.kind if ending else "different",
            "text": ending.text if ending else "the vehicle holds another mission",
            "differences": [str(each) for each in report.differences],
            "findings": report.findings,
            "flight": debriefing_as_dict(found) if found else None,
        },
        lambda: [joined(flight_lines(report, found))],
        as_json=as_json,
        good=ending is not None and ending.kind == "finished",
    )


def debrief(
    log: Path = typer.Argument(metavar="LOG", help="The log: .bin, .tlog or .ulg."),
    plan_file: cli.File = cli.PLAN_FILE,
    solution_file: cli.File = cli.SOLUTION_FILE,
    system: int | None = cli.SYSTEM,
    report: cli.File = cli.option("PAGE.html", "One page with all three tracks."),
    as_json: bool = cli.AS_JSON,
) -> None:
    """Say what became of a plan, from the log of its flight.

    Finds the relay flight in the log of an ArduPilot (.bin), a PX4 (.ulg, with pyulog) or a ground
    station (.tlog), and tells how late it was, how far from plan and path, and what each hop
    carried along the real track with the planned precoders, beside what was planned and predicted.
    Of several vehicles in a .tlog it is the one whose flight is the plan's, or that of --system.

    Exit status: 0 told; 1 the plan's flight is not in the log; 2 unusable arguments or input.
    """
    if plan_file is None and solution_file is None:
        raise InputError("--plan or --solution: give the plan that was flown")
    inputs = {"LOG": log, "--plan": plan_file, "--solution": solution_file}
    cli.check_outputs({"--report": report}, inputs)
    from faao_mav.fly.logs import read_log
    from faao_mav.report.debrief import FromLog
    from faao_mav.report.summary import joined
    from faao_mav.workflow import Result, with_mission

    records = read_log(log, system)  # what is no log is refused before the plan is solved
    solution = cli.planned(plan_file, solution_file)
    assert solution is not None
    told = FromLog.of(records, with_mission(Result(solution)), str(log))
    if report is not None:
        from faao_mav.report.page import render_report

        page = render_report(told, title=log.name)
        write_whole(report, page.encode())
    cli.show(told.as_dict, lambda: [joined(told.lines())], as_json=as_json)
