"""`faao-mission PLAN.yaml --out MISSION`: from a plan to a mission file."""

import json
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from faao_mav.cli.outcome import exit_status
from faao_mav.errors import FaaoError, InputError
from faao_mav.files import check_writable, write_whole


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

    Exit status: 0 done; 1 there is no such flight or mission; 2 unusable arguments or input.
    """
    with exit_status():
        _run(plan_file, out, save, precoders, method, bound, as_json, quiet)


def _run(
    plan_file: Path,
    out: Path | None,
    save: Path | None,
    precoders: Path | None,
    method: str | None,
    bound: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    from faao_mav.cli.progress import progress
    from faao_mav.cli.summary import Result, as_dict, as_text
    from faao_mav.faao.optimize import optimize
    from faao_mav.faao.pricing import fresh_rates, price, saturation
    from faao_mav.faao.problem import build_problem
    from faao_mav.faao.solution import save_solution
    from faao_mav.mission.convert import convert
    from faao_mav.mission.flight import copter_model
    from faao_mav.mission.formats import check_suffix, render_mission
    from faao_mav.mission.parameter_file import parameter_path, render_parameters
    from faao_mav.mission.precoder_table import precoder_table
    from faao_mav.mission.prediction import predict_delivery
    from faao_mav.mission.recommend import candidates
    from faao_mav.mission.vehicle import vehicle_of
    from faao_mav.plan import read_plan

    started = time.perf_counter()
    read = read_plan(plan_file, method=method)
    copter_model(vehicle_of(read))  # a useless parameter is refused before the work, not after it
    tuned = None
    if out is not None:
        check_suffix(out)
        tuned = parameter_path(out, read.vehicle.autopilot) if any(candidates(read)) else None
    if save is not None and save.suffix != ".npz":
        raise InputError(f"--save {save}: give a name that ends in .npz")
    targets = [path for path in (out, tuned, save, precoders) if path is not None]
    for path in targets:
        check_writable(path)
    with progress(shown=sys.stderr.isatty() and not quiet) as observe:
        optimizing = time.perf_counter()
        solution = optimize(read, observe=observe)
        optimized = time.perf_counter() - optimizing
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
            write_whole(precoders, precoder_table(solution).encode())
        if tuned is not None:
            text = render_parameters(
                conversion.parameters, read.vehicle.autopilot, header=f"for {out}"
            )
            write_whole(tuned, text.encode())
        if out is not None:
            rendered = render_mission(conversion.mission, out, conversion.vehicle)
            write_whole(out, rendered.encode())
        information, fresh = price(solution), fresh_rates(solution)
        limit = saturation(solution)
        ceiling = None
        if bound:
            from faao_mav.faao.bound import upper_bound

            ceiling = upper_bound(build_problem(read), solution.rates.R_avg)
    result = Result(
        solution=solution,
        information=information,
        fresh=fresh,
        saturation=limit,
        bound=ceiling,
        conversion=conversion,
        prediction=prediction,
        seconds_optimize=optimized,
        seconds_total=time.perf_counter() - started,
        written=tuple(targets),
    )
    if as_json:
        typer.echo(json.dumps(as_dict(result), allow_nan=False))
    elif not quiet:
        typer.echo(as_text(result))
