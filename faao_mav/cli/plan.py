"""`faao-mission PLAN.yaml --out MISSION`: from a plan to a mission file."""

import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from faao_mav.cli.options import AllowArmed, System
from faao_mav.cli.outcome import exit_status, note
from faao_mav.errors import FaaoError, InputError
from faao_mav.files import check_apart, check_writable, write_whole

if TYPE_CHECKING:
    from faao_mav.cli.summary import Result

_FOR = "for "  # how the file of parameters begins


def plan(
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN.yaml", help="The plan.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="MISSION",
            help="Write the mission: .waypoints, .txt, .plan or .kml.",
        ),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(metavar="RESULT.npz", help="Write trajectory, precoders and rates."),
    ] = None,
    precoders: Annotated[
        Path | None,
        typer.Option(metavar="TABLE.csv", help="Write the precoders by time and position."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Write a page about the flight."),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the flight: .png, .svg or .pdf."),
    ] = None,
    upload: Annotated[
        str | None,
        typer.Option(metavar="CONNECTION", help="Upload the mission to a vehicle, and verify it."),
    ] = None,
    system: System = None,
    allow_armed: AllowArmed = False,
    method: Annotated[
        str | None,
        typer.Option(metavar="M", help="Replace optimizer.method: direct or algorithm1."),
    ] = None,
    bound: Annotated[
        bool, typer.Option("--bound", help="Also compute what no route can exceed.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the summary.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Optimise a radio-relay flight and write it as a MAVLink mission.

    The mission is validated, with the parameters that it is timed for. One with errors is
    written, to be looked at, but not uploaded.

    Exit status: 0 done; 1 there is no such flight or mission, validation found errors, or it is
    not known to be on the vehicle; 2 unusable arguments or input.
    """
    with exit_status():
        if upload is None and (system is not None or allow_armed):
            option = "--allow-armed" if system is None else f"--system {system}"
            raise InputError(f"{option}: is for an upload; give --upload CONNECTION too")
        result = _solve(
            plan_file, out, save, precoders, report, figure, upload, method, bound, quiet
        )
        sound = _sound(result)
        failure = None
        if upload is not None and sound:
            shown = sys.stderr.isatty() and not quiet
            result, failure = _uploaded(result, upload, system, allow_armed, shown)
        _show(result, as_json, quiet)
        if failure is not None:
            raise failure
        if not sound or (result.upload is not None and not result.upload.verified):
            raise typer.Exit(1)


def _solve(
    plan_file: Path,
    out: Path | None,
    save: Path | None,
    precoders: Path | None,
    report: Path | None,
    figure: Path | None,
    upload: str | None,
    method: str | None,
    bound: bool,
    quiet: bool,
) -> "Result":
    from faao_mav.cli import report as reports
    from faao_mav.cli.progress import progress
    from faao_mav.cli.summary import Result
    from faao_mav.mission.formats import check_suffix, render_mission
    from faao_mav.optimizer.optimize import optimize
    from faao_mav.optimizer.pricing import fresh_rates, price, saturation
    from faao_mav.optimizer.problem import build_problem
    from faao_mav.optimizer.solution import Progress, save_solution
    from faao_mav.plan import read_plan
    from faao_mav.schedule.conversion import check_vehicle, convert
    from faao_mav.schedule.prediction import predict_delivery
    from faao_mav.validate import Limits
    from faao_mav.validate.check import check
    from faao_mav.vehicle.parameter_file import parameter_path, render_parameters
    from faao_mav.vehicle.recommend import candidates

    started = time.perf_counter()
    read = read_plan(plan_file, method=method)
    check_vehicle(read)
    vehicles = candidates(read)
    tuned = None
    if out is not None:
        check_suffix(out)
        tuned = parameter_path(out, read.vehicle.autopilot) if any(vehicles) else None
    if save is not None and save.suffix != ".npz":
        raise InputError(f"--save {save}: give a name that ends in .npz")
    reports.check_names(report, figure)
    if upload is not None:
        from faao_mav.mavlink.transport import parse_connection

        parse_connection(upload)
    files = (out, tuned, save, precoders, report, figure)
    targets = [path for path in files if path is not None]
    for path in targets:
        check_writable(path)
    if tuned is not None:
        _check_own(tuned)
    names = ("--out", "the parameters of --out,", "--save", "--precoders", "--report", "--figure")
    check_apart(dict(zip(names, files, strict=True)), {"PLAN.yaml": plan_file})
    with progress(shown=sys.stderr.isatty() and not quiet) as observe:
        optimizing = time.perf_counter()
        solution = optimize(read, observe=observe)
        optimized = time.perf_counter() - optimizing
        if observe is not None:
            observe(Progress(1, 1, "the mission's timing", solution.rates.R_avg))
        try:
            conversion = convert(solution)
        except FaaoError:
            if save is not None:  # what was found is not lost with the mission
                save_solution(solution, save)
            raise
        prediction = predict_delivery(solution, conversion)
        if save is not None:
            save_solution(solution, save, conversion.schedule.track())
        if precoders is not None:
            from faao_mav.schedule.precoder_table import precoder_table

            write_whole(precoders, precoder_table(solution).encode())
        if out is not None and tuned is not None:
            text = render_parameters(
                conversion.parameters, read.vehicle.autopilot, header=f"{_FOR}{out.name}"
            )
            write_whole(tuned, text.encode(errors="replace"))  # a name may be no Unicode
        if out is not None:
            if out.suffix.lower() == ".kml":
                from faao_mav.report.drawing import draw_mission

                rendered = draw_mission(solution, conversion)
            else:
                rendered = render_mission(conversion.mission, out, conversion.vehicle)
            write_whole(out, rendered.encode())
        checked = check(
            conversion.mission,
            conversion.vehicle,
            limits=Limits(max_speed=read.vehicle.max_speed),
            solution=solution,
            lead=conversion.schedule.route.lead,
        )
        information, fresh = price(solution), fresh_rates(solution)
        limit = saturation(solution)
        ceiling = None
        if bound:
            from faao_mav.optimizer.search.bound import upper_bound

            ceiling = upper_bound(build_problem(read), solution.rates.R_avg)
        result = Result(
            solution=solution,
            information=information,
            fresh=fresh,
            saturation=limit,
            bound=ceiling,
            conversion=conversion,
            prediction=prediction,
            findings=checked.findings,
            seconds_optimize=optimized,
            seconds_total=0.0,
            written=tuple(targets),
        )
        reports.write(report, figure, result)
    return replace(result, seconds_total=time.perf_counter() - started)


def _check_own(tuned: Path) -> None:
    """Refuse to replace parameters that no run has written: the vehicle's own, perhaps."""
    if not tuned.exists():
        return
    with tuned.open("rb") as file:
        beginning = file.read(len(_FOR) + 2)
    if beginning != f"# {_FOR}".encode():
        raise InputError(
            f"{tuned}: the mission's parameters are to go there, but it is not of an earlier run; "
            "rename it, or give --out another name"
        )


def _sound(result: "Result") -> bool:
    """Say the errors that validation found, and whether there are none."""
    from faao_mav.cli.finding_lines import grouped, line_of
    from faao_mav.validate.finding import Level

    errors = [finding for finding in result.findings if finding.level is Level.ERROR]
    for group in grouped(errors):
        note(f"{line_of(group)}; {group[0].action}")
    if errors:
        note("the mission does not pass validation; do not fly it")
    return not errors


def _uploaded(
    result: "Result", connection: str, system: int | None, allow_armed: bool, shown: bool
) -> "tuple[Result, FaaoError | None]":
    """Return `result` with what became of its upload, and the error that prevented it."""
    from faao_mav.cli.transfer_progress import transfer_progress
    from faao_mav.mavlink.client import upload

    mission = result.conversion.mission
    with transfer_progress(shown=shown) as observe:
        try:
            report = upload(
                mission, connection, system=system, allow_armed=allow_armed, observe=observe
            )
        except FaaoError as error:
            return result, error
    if not report.verified:
        note("the mission is not verified; do not fly it")
    return replace(result, upload=report), None


def _show(result: "Result", as_json: bool, quiet: bool) -> None:
    from faao_mav.cli.summary import as_dict, as_text

    if as_json:
        typer.echo(json.dumps(as_dict(result), allow_nan=False))
    elif not quiet:
        typer.echo(as_text(result))
