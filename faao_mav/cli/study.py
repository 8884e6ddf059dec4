"""`faao-mission study PLAN.yaml`: one plan with many values, schemes and seeds."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import faao_mav.cli.shared as cli
from faao_mav.errors import InputError, PlanError

if TYPE_CHECKING:
    from faao_mav.plan import Plan
    from faao_mav.study import StudyCase, StudyRow

_POINTS = 12  # of a frontier, unless told otherwise. Chosen: a smooth curve by eye
_INTERRUPTED = 130  # the exit status of an interrupted study, as a shell reports SIGINT: 128 + 2


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is varied."""

    vary: list[str] | None = cli.option(
        "KEY=VALUES", "start:stop:step or a,b,c; several make a grid."
    )
    power: str | None = cli.option("VALUES", "Both powers, dBm: -40:0:5 or a,b,c.")
    schemes: str | None = cli.option("S,S", "Of faao,algorithm1,mmse,mrt,zf,waterfilling,gaussian.")
    seeds: int | None = cli.option("N", "Draws of the fading, from radio.seed.", min=1)
    frontier: str | None = cli.option(
        "AXIS,data", "The most data for every AXIS: duration, power or energy."
    )
    points: int | None = cli.option("N", "Points of the frontier; without it 12.", min=2)

    def cases(self, plan: "Plan") -> "Sequence[StudyCase]":
        """Return the cases of a plan.

        Raises `PlanError` for values that no case can use; some may fail and become rows.
        """
        from faao_mav.plan import parse_plan
        from faao_mav.plan.keys import POWER
        from faao_mav.plan.sections import Study
        from faao_mav.study import make_cases, parse_vary
        from faao_mav.study.sweep import check_varied, frontier_cases, parse_values

        options = [parse_vary(text) for text in self.vary or []]
        if self.power is not None:
            options.append((POWER, parse_values(self.power, "--power")))
        check_varied(key for key, _ in options)
        if self.points is not None and self.frontier is None:
            raise InputError(f"--points {self.points}: is for a frontier; give --frontier too")
        if self.schemes is not None:
            names = dict.fromkeys(name.strip() for name in self.schemes.split(","))
            plan = plan.changed({"study.schemes": [*names]})
        asked = plan.study or Study()
        grid: dict[str, Any] = {
            "vary": dict(options) if options or self.frontier else asked.vary,
            "schemes": asked.schemes,
            "seeds": self.seeds or asked.seeds,
        }
        if self.frontier is not None:
            cases = frontier_cases(plan, self.frontier, self.points or _POINTS, **grid)
        else:
            cases = make_cases(plan.text, source=plan.source, **grid)
        refused = []
        for case in cases:
            try:
                parse_plan(case.text, case.source)
            except PlanError as error:
                refused.append(error)
            else:
                return cases
        raise refused[0]


@cli.with_options(asked=_Asked)
def study(
    plan_file: Path = typer.Argument(metavar="PLAN.yaml", help="The plan."),
    *,
    asked: _Asked,
    jobs: int = cli.option("N", "Processes; -1: one a core.", default=-1),
    cluster: str | None = cli.option(
        "ADDRESS", "A Dask scheduler, tcp://host:port, not processes."
    ),
    out: cli.File = cli.option("DIR", "Keep rows there as they finish; go on where it ended."),
    as_json: bool = cli.AS_JSON,
) -> None:
    """Optimise a plan with many values, schemes and seeds, and compare.

    Options replace what the plan's `study` section says. With --out the directory gets
    rows while it runs, a file each, and table.csv, figure.svg and figure.png at the end.

    Exit status: 0 done; 1 no row has a result; 2 unusable arguments or input; 130 interrupted.
    """
    from faao_mav.plan import read_plan
    from faao_mav.plan.sections import Study
    from faao_mav.report.style import save_figure
    from faao_mav.study import run_study
    from faao_mav.study.figure import study_figure
    from faao_mav.study.rows import as_dict, comparison

    plan = read_plan(plan_file)
    cases, kind = asked.cases(plan), (plan.study or Study()).figure
    if asked.frontier is not None and kind != "trajectories":
        kind = "data"
    try:
        with cli.progress() as draw:
            done = itertools.count(1)

            def observe(row: "StudyRow") -> None:
                draw(row.scheme, next(done), len(cases))

            rows = run_study(cases, jobs=jobs, cluster=cluster, directory=out, observe=observe)
    except KeyboardInterrupt:
        kept = "nothing was kept; give --out DIR to go on where it ended"
        if out is not None:
            kept = f"finished rows are in {out}; the same command goes on there"
        cli.note(f"interrupted; {kept}")
        raise typer.Exit(_INTERRUPTED) from None
    written = []
    if out is not None:
        written = [out / "rows", out / "table.csv"]
        try:
            figure = study_figure(rows, plan, kind)
        except InputError:
            pass  # there is nothing to draw
        else:
            for path in (out / "figure.svg", out / "figure.png"):
                save_figure(figure, path)
                written.append(path)
    text = comparison(rows, data=asked.frontier is not None or kind == "data")
    cli.show(
        lambda: {"rows": [as_dict(row) for row in rows], "written": written},
        lambda: [text, *(f"written      {path}" for path in written)],
        as_json=as_json,
        good=not all(row.error for row in rows),
    )
