"""`faao-mission PLAN.yaml --out MISSION`: from a plan to a mission file."""

from pathlib import Path
from typing import TYPE_CHECKING

import typer

import faao_mav.cli.shared as cli
from faao_mav.cli.vehicle import as_dict, send
from faao_mav.errors import FaaoError, InputError

if TYPE_CHECKING:
    from faao_mav.plan import Plan
    from faao_mav.workflow import Result


def plan(
    plan_file: Path = typer.Argument(metavar="PLAN.yaml", help="The plan."),
    out: cli.File = cli.option("MISSION", "Write the mission: .waypoints, .txt, .plan or .kml."),
    save: cli.File = cli.option("RESULT.npz", "Write trajectory, precoders and rates."),
    precoders: cli.File = cli.option("TABLE.csv", "Write the precoders by time and place."),
    report: cli.File = cli.option("FILE.html", "Write a page about the flight."),
    figure: cli.File = cli.option("FILE", "Draw the flight: .png, .svg or .pdf."),
    upload: str | None = cli.option(
        "CONNECTION", "Upload the mission to a vehicle, and verify it."
    ),
    system: int | None = cli.SYSTEM,
    allow_armed: bool = cli.ALLOW_ARMED,
    force: bool = cli.flag(
        "--force", "Make the mission of a plan beyond the vehicle all the same."
    ),
    method: str | None = cli.option("M", "Replace optimizer.method: direct or algorithm1."),
    bound: bool = cli.flag("--bound", "Also estimate what no route can exceed."),
    as_json: bool = cli.AS_JSON,
    quiet: bool = cli.flag("--quiet", "Print nothing but errors."),
    verbose: bool = cli.flag("--verbose", "Print how the flight was found, and every rate."),
) -> None:
    """Optimise a radio-relay flight and write it as a MAVLink mission.

    The mission is validated, with the parameters that it is timed for. One with errors is
    written, to be looked at, but not uploaded. Without --out and --upload the plan is only
    optimised, and what validation finds is information.

    A plan whose max_speed or max_acceleration is beyond the vehicle is refused with --out and
    --upload, before the work: no mission keeps it.

    Exit status: 0 done; 1 there is no such flight, or with --out or --upload no such mission,
    validation found errors, or it is not known to be on the vehicle; 2 unusable arguments or
    input.
    """
    from faao_mav.report import summary
    from faao_mav.report.page import write_part
    from faao_mav.workflow import plan_mission

    if upload is None and (system is not None or allow_armed):
        given = "--allow-armed" if system is None else f"--system {system}"
        raise InputError(f"{given}: is for an upload; give --upload CONNECTION too")
    files = {"--save": save, "--precoders": precoders, "--report": report, "--figure": figure}
    to_fly = out is not None or upload is not None
    if force and not to_fly:
        raise InputError("--force: is for a mission; give --out MISSION or --upload CONNECTION too")
    plan = _checked_plan(plan_file, method, out, files, upload, force)
    with cli.optimizer_progress(quiet=quiet) as observe:
        result = plan_mission(plan, bound=bound, observe=observe)
        for name, path in files.items():
            if path is not None:
                write_part(result, name.removeprefix("--"), path)
        mission = result.write(out) if out is not None else ()
    written = [*mission, *filter(None, files.values())]
    if to_fly and result.no_mission is not None:
        raise result.no_mission
    sound = not to_fly or _sound(result)
    uploaded, failure = None, None
    if upload is not None and sound and result.conversion is not None:
        from faao_mav.fly.preflight import Flight

        flight = Flight.planned(result.conversion, result.solution)
        options = {"system": system, "allow_armed": allow_armed, "made_for": flight.made_for}
        try:
            uploaded = send(flight.mission, upload, quiet=quiet, **options)
        except FaaoError as error:  # told after the result
            failure = error
    if not quiet or as_json:
        cli.show(
            lambda: result.as_dict() | {"upload": as_dict(uploaded) if uploaded else None},
            lambda: [
                summary(result, written, verbose=verbose),
                *([str(uploaded)] if uploaded else []),
            ],
            as_json=as_json,
        )
    if failure is not None:
        raise failure
    if not sound or (uploaded is not None and not uploaded.verified):
        raise typer.Exit(1)


def _checked_plan(
    plan_file: Path,
    method: str | None,
    out: Path | None,
    files: dict[str, Path | None],
    upload: str | None,
    force: bool,
) -> "Plan":
    """Return the plan; what it asks for and where to is refused before the work if of no use."""
    from faao_mav.plan import read_plan
    from faao_mav.schedule.conversion import beyond_vehicle, check_vehicle
    from faao_mav.workflow import mission_files

    plan = read_plan(plan_file)
    if method is not None:
        plan = plan.changed({"optimizer.method": method})
    to_fly = out is not None or upload is not None
    if to_fly:
        check_vehicle(plan)
    else:
        plan.aircraft.flight_model()  # what is useless is refused, what is not flown is told
    beside = mission_files(out, plan)[1:] if out is not None else ()
    of_out = {
        f"the {'parameters' if path.suffix.startswith('.param') else 'fence'} of --out,": path
        for path in beside
    }
    cli.check_outputs({"--out": out, **of_out, **files}, {"PLAN.yaml": plan_file})
    if upload is not None:
        from faao_mav.wire.transport import parse_connection

        parse_connection(upload)
    if to_fly and not force and (beyond := beyond_vehicle(plan)):
        end = "give that or less, or --force to make the mission all the same"
        raise InputError("\n".join(f"{each}; {end}" for each in beyond))
    return plan


def _sound(result: "Result") -> bool:
    """Say the errors that validation found, and whether there are none."""
    from faao_mav.validate import Level
    from faao_mav.validate.rule import by_rule, line_of

    errors = [finding for finding in result.findings if finding.level is Level.ERROR]
    for group in by_rule(errors):
        cli.note("; ".join(filter(None, (line_of(group), group[0].action))))
    if errors:
        cli.note("the mission does not pass validation; do not fly it")
    return not errors
