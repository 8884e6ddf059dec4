"""`faao-mission PLAN.yaml --out MISSION`: from a plan to a mission file."""

import json
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from faao_mav.cli.outcome import exit_status
from faao_mav.errors import InputError
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
        _run(plan_file, out, save, method, bound, as_json, quiet)


def _run(
    plan_file: Path,
    out: Path | None,
    save: Path | None,
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
    from faao_mav.mission import assemble, plan_route
    from faao_mav.mission.autopilot import legs_of
    from faao_mav.mission.formats import check_suffix, render_mission
    from faao_mav.mission.vehicle import vehicle_of
    from faao_mav.plan import read_plan

    started = time.perf_counter()
    if out is not None:
        check_suffix(out)
        check_writable(out)
    if save is not None:
        if save.suffix != ".npz":
            raise InputError(f"--save {save}: give a name that ends in .npz")
        check_writable(save)
    read = read_plan(plan_file, method=method)
    legs_of(read)  # a useless vehicle parameter is refused before the work, not after it
    with progress(shown=sys.stderr.isatty() and not quiet) as observe:
        optimizing = time.perf_counter()
        solution = optimize(read, observe=observe)
        optimized = time.perf_counter() - optimizing
        if save is not None:
            save_solution(solution, save)
        route = plan_route(solution.t, solution.w, read)
        mission = assemble(route, read)
        if out is not None:
            write_whole(out, render_mission(mission, out, vehicle_of(read)).encode())
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
        mission=mission,
        route=route,
        seconds_optimize=optimized,
        seconds_total=time.perf_counter() - started,
        written=tuple(path for path in (out, save) if path is not None),
    )
    if as_json:
        typer.echo(json.dumps(as_dict(result), allow_nan=False))
    elif not quiet:
        typer.echo(as_text(result))
