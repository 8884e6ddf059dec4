"""All cases of a study over all cores, each kept as soon as it is done."""

import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

from faao_mav.errors import FaaoError, InputError, check_extra
from faao_mav.files import check_writable, write_whole
from faao_mav.processes import apart_from_the_current_directory
from faao_mav.study.rows import ROWS, TABLE, StudyRow, in_order, keep_row, load_rows, table
from faao_mav.study.sweep import StudyCase

_CONNECTING = 10
"""Seconds that a cluster has to answer; chosen: a scheduler that runs answers in one."""


def run_case(case: StudyCase) -> StudyRow:
    """Return the row of `case`; whatever goes wrong becomes the row's error."""
    from threadpoolctl import threadpool_limits

    from faao_mav.plan import parse_plan
    from faao_mav.workflow import optimize_plan

    row = StudyRow(case.key, dict(case.values), case.scheme, case.seed)
    try:
        with threadpool_limits(1):  # the cores are taken by other cases
            result = optimize_plan(parse_plan(case.text, case.source))
    except FaaoError as error:
        return replace(row, error=str(error))
    except Exception as error:  # a fault in one case must not cost the others
        return replace(row, error=f"{type(error).__name__}: {error}")
    solution, rates, information = result.solution, result.solution.rates, result.information
    return replace(
        row,
        R_avg=rates.R_avg,
        R_U=rates.R_U,
        R_G=rates.R_G,
        delivered=solution.delivered_rate,
        delivered_mbytes=solution.plan.megabytes(solution.delivered_rate),
        duration=solution.plan.flight.duration,
        mutual_information=information.average if information else None,
        rate=solution.plan.optimizer.rate,
        seconds=round(result.seconds_optimize, 3),
        iterations=solution.iterations,
        converged=solution.converged,
        route=tuple((east, north) for east, north in solution.w.round(3).tolist()),
    )


def run_study(
    cases: Sequence[StudyCase],
    *,
    jobs: int = -1,
    cluster: str | None = None,
    directory: Path | None = None,
    observe: Callable[[StudyRow], None] | None = None,
) -> tuple[StudyRow, ...]:
    """Return the rows of `cases` in their order.

    `jobs` processes, -1 for one on each core; or the workers of the Dask `cluster` at an address as
    `tcp://host:8786`, which need this package too. With a `directory` every row is kept there when
    it is done, rows that are there already are not run again, and the table is written at the end.
    `observe` is told each row, old ones first. Raises `InputError` for what is of no use.

    >>> from faao_mav import as_array, make_cases, read_plan
    >>> plan = read_plan("missions/copter_relay.yaml")
    >>> cases = make_cases(plan.text, vary={"flight.altitude": [60, 120], "flight.time_step": [2]})
    >>> rows = as_array(run_study(cases, jobs=1))
    >>> rows["flight.altitude"].tolist(), bool(rows["delivered"][0] > rows["delivered"][1])
    ([60, 120], True)
    """
    if jobs == 0:
        raise InputError("jobs 0: give a number of processes, or -1 for one a core")
    with nullcontext() if cluster is None else _connected(cluster):
        old = _prepare(directory, cases) if directory is not None else ()
        tell = observe or (lambda _: None)
        for row in old:
            tell(row)
        done = {row.key: row for row in old}
        running = _rows([case for case in cases if case.key not in done], jobs, cluster)
        try:
            for row in running:
                if directory is not None:
                    keep_row(row, directory)
                done[row.key] = row
                tell(row)
        finally:
            with warnings.catch_warnings(action="ignore"):  # joblib says that it leaves work undone
                running.close()
        rows = in_order(cases, done)
        if directory is not None:
            write_whole(directory / TABLE, table(rows).encode())
        return rows


def _rows(
    cases: Sequence[StudyCase], jobs: int, cluster: str | None
) -> Generator[StudyRow, None, None]:
    """Run `cases`; yield their rows as they finish. With a `cluster` joblib is connected to it."""
    from joblib import Parallel, delayed, effective_n_jobs

    processes = min(effective_n_jobs(jobs), len(cases))  # no more than there is work for
    if cluster is None and processes <= 1:
        yield from map(run_case, cases)
        return
    count = {"n_jobs": processes} if cluster is None else {}
    with apart_from_the_current_directory():
        workers = Parallel(return_as="generator_unordered", batch_size=1, **count)
        yield from workers(delayed(run_case)(case) for case in cases)


@contextmanager
def _connected(address: str) -> Iterator[None]:
    from joblib import parallel_config

    check_extra("cluster", "distributed", f"cluster {address}: a study there")
    from distributed import Client

    try:
        client = Client(address, timeout=_CONNECTING)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise InputError(f"cluster {address}: no scheduler there: {error}") from None
    with client, parallel_config(backend="dask"):
        yield


def _prepare(directory: Path, cases: Sequence[StudyCase]) -> tuple[StudyRow, ...]:
    try:
        (directory / ROWS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory / ROWS}: cannot be made: {error.strerror or error}") from None
    check_writable(directory / TABLE)
    return load_rows(directory, cases)
