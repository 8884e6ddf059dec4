"""`faao-mission study PLAN.yaml`: one plan with many values, schemes and seeds."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from faao_mav.cli.outcome import exit_status, note
from faao_mav.errors import InputError

if TYPE_CHECKING:
    from faao_mav.plan import Plan
    from faao_mav.study import Case, Row

_INTERRUPTED = 130  # as a shell reports it


def study(
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN.yaml", help="The plan.")],
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUES", help="start:stop:step or a,b,c; several make a grid."),
    ] = None,
    power: Annotated[
        str | None,
        typer.Option(metavar="VALUES", help="Both powers, dBm: -40:0:5 or a,b,c."),
    ] = None,
    schemes: Annotated[
        str | None,
        typer.Option(metavar="S,S", help="Of faao,algorithm1,mmse,mrt,zf,waterfilling,gaussian."),
    ] = None,
    seeds: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Draws of the fading, from radio.seed.")
    ] = None,
    jobs: Annotated[int, typer.Option(metavar="N", help="Processes; -1: one a core.")] = -1,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A Dask scheduler, tcp://host:port, not processes."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep rows there as they finish; go on where it ended."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the table.")
    ] = False,
) -> None:
    """Optimise a plan with many values, schemes and seeds, and compare.

    Options replace what the plan's `study` section says. With --out the directory gets
    rows.jsonl while it runs, and table.csv, figure.svg and figure.png at the end.

    Exit status: 0 done; 1 no row has a result; 2 unusable arguments or input; 130 interrupted.
    """
    with exit_status():
        _run(plan_file, vary or [], power, schemes, seeds, jobs, cluster, out, as_json)


def _run(
    plan_file: Path,
    vary: Sequence[str],
    power: str | None,
    schemes: str | None,
    seeds: int | None,
    jobs: int,
    cluster: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    from faao_mav.plan import read_plan
    from faao_mav.plan.keys import POWER
    from faao_mav.plan.model import Study
    from faao_mav.study import make_cases, parse_vary, run_study
    from faao_mav.study.sweep import join_grid, parse_schemes, parse_values

    if jobs == 0:
        raise InputError("--jobs 0: give a number of processes, or -1 for one a core")
    plan = read_plan(plan_file)
    asked = plan.study or Study()
    options = [parse_vary(text) for text in vary]
    if power is not None:
        options.append((POWER, parse_values(power, "--power")))
    grid = join_grid(options)
    cases = make_cases(
        plan.text,
        vary=grid or asked.vary,
        schemes=parse_schemes(schemes) if schemes is not None else asked.schemes,
        seeds=seeds or asked.seeds,
        source=str(plan_file),
    )
    _check_cases(cases)
    try:
        with _progress(len(cases), shown=sys.stderr.isatty()) as observe:
            rows = run_study(cases, jobs=jobs, cluster=cluster, directory=out, observe=observe)
    except KeyboardInterrupt:
        kept = (
            f"finished rows are in {out}; the same command goes on there"
            if out
            else ("nothing was kept; give --out DIR to go on where it ended")
        )
        note(f"interrupted; {kept}")
        raise typer.Exit(_INTERRUPTED) from None
    written = _draw(rows, plan, asked.figure, out) if out is not None else []
    _tell(rows, written, as_json)
    if all(row.error for row in rows):
        raise typer.Exit(1)


def _draw(rows: "Sequence[Row]", plan: "Plan", kind: str, out: Path) -> list[Path]:
    """Add the figure to what the study has written, where there is something to draw."""
    from faao_mav.report.style import save_figure
    from faao_mav.study.figure import can_draw, study_figure

    written = [out / "rows.jsonl", out / "table.csv"]
    if can_draw(rows, kind):
        figure = study_figure(rows, plan, kind)
        for path in (out / "figure.svg", out / "figure.png"):
            save_figure(figure, path)
            written.append(path)
    return written


def _check_cases(cases: "Sequence[Case]") -> None:
    """Refuse values that no case can use, before any work; some may fail and become rows."""
    from faao_mav.errors import PlanError
    from faao_mav.plan import parse_plan

    first: PlanError | None = None
    for case in cases:
        try:
            parse_plan(case.text, case.source)
        except PlanError as error:
            first = first or error
        else:
            return
    if first is not None:
        raise first


@contextmanager
def _progress(total: int, *, shown: bool) -> "Iterator[Callable[[Row], None] | None]":
    """Give an observer that draws a bar on standard error, or None where nothing is `shown`."""
    if not shown:
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
    from rich.progress import TimeRemainingColumn as Remaining

    columns = (BarColumn(), MofNCompleteColumn(), Remaining(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)

        def observe(row: "Row") -> None:
            bar.update(task, advance=1, description=row.scheme)

        yield observe


def _tell(rows: "Sequence[Row]", written: Sequence[Path], as_json: bool) -> None:
    from faao_mav.study.rows import as_dict

    if as_json:
        found: dict[str, Any] = {"rows": [as_dict(row) for row in rows]}
        found["written"] = [str(path) for path in written]
        typer.echo(json.dumps(found, allow_nan=False))
        return
    from faao_mav.study.compare import comparison

    typer.echo(comparison(rows))
    for path in written:
        typer.echo(f"written      {path}")
