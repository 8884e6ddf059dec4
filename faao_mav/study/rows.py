"""The rows of a study: kept as they finish, as a table, and side by side."""

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter, ValidationError

from faao_mav.errors import InputError, counted, place_of
from faao_mav.files import read_bytes, write_whole
from faao_mav.study.sweep import StudyCase, Value

ROWS, TABLE = "rows", "table.csv"
"""The folder of a study's rows, a file for each, and its table."""

MAX_BYTES = 10_000_000
"""Bytes of a row that are read; chosen: a flight of 500,000 slots."""


@dataclass(frozen=True, slots=True)
class StudyRow:
    """What one case of a study led to.

    Rates and mutual information are bit/s/Hz, and `rate` names that which R_avg and all others are
    of, `optimizer.rate`; `delivered` is the delivered rate and
    `delivered_mbytes` what a flight carries, 10^6 bytes, None without a bandwidth; `duration` is
    that of the flight, s, `seconds` the time of the optimiser. Where there is no result `error`
    says why and the numbers are None.
    `route` is w, [east, north] of each slot, m.

    >>> row = StudyRow("", {"flight.altitude": 60}, "faao", 0, R_avg=1.5, delivered=1.4)
    >>> row.values["flight.altitude"], row.delivered, len(row.route)
    (60, 1.4, 0)
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    key: str
    values: Mapping[str, Value]
    scheme: str
    seed: int
    R_avg: float | None = None
    R_U: float | None = None
    R_G: float | None = None
    delivered: float | None = None
    delivered_mbytes: float | None = None
    duration: float | None = None
    mutual_information: float | None = None
    rate: str = "cutoff"
    seconds: float | None = None
    iterations: int | None = None
    converged: bool | None = None
    error: str = ""
    route: tuple[tuple[float, float], ...] = ()

    @property
    def data(self) -> float | None:
        """What a flight carries: `delivered_mbytes`, or without a bandwidth bit/Hz."""
        if self.delivered_mbytes is not None or self.delivered is None or self.duration is None:
            return self.delivered_mbytes
        return self.delivered * self.duration


_ROW: TypeAdapter[StudyRow] = TypeAdapter(StudyRow)

_RESULTS = [each.name for each in fields(StudyRow) if each.name not in ("key", "values", "route")]
"""The fields of a row that are columns of the table."""


def as_dict(row: StudyRow) -> dict[str, Any]:
    """Return `row` as an object of `--json`: varied keys, then the columns of the table."""
    return {**row.values, **{name: getattr(row, name) for name in _RESULTS}}


def as_array(rows: Sequence[StudyRow]) -> NDArray[np.void]:
    """Return `rows` as a structured array: a field for each varied key and column of the table.

    Numbers that a row does not have are NaN, texts empty. `pandas.DataFrame(as_array(rows))` is the
    same as a table of pandas.

    >>> rows = [StudyRow("", {"power_dbm": dbm}, "faao", 0, R_avg=dbm / 10) for dbm in (5, 10)]
    >>> table = as_array(rows)
    >>> table["power_dbm"].tolist(), table["R_avg"].tolist()
    ([5, 10], [0.5, 1.0])
    """
    records, columns = [as_dict(row) for row in rows], {}
    for name in dict.fromkeys(name for record in records for name in record):
        values = [record.get(name) for record in records]
        missing = "" if any(isinstance(value, str) for value in values) else math.nan
        columns[name] = np.array([missing if value is None else value for value in values])
    kinds = [(name, column.dtype, column.shape[1:]) for name, column in columns.items()]
    made = np.empty(len(rows), kinds)
    for name, column in columns.items():
        made[name] = column
    return made


def keep_row(row: StudyRow, directory: Path) -> None:
    """Write the file of `row` in the `directory` of its study. Raises `InputError`."""
    content = json.dumps(asdict(row), allow_nan=False)
    try:
        write_whole(directory / ROWS / f"{row.key}.json", content.encode())
    except InputError as error:
        raise InputError(
            f"{error}; the rows before are kept, and the same command goes on there"
        ) from None


def load_rows(directory: Path, cases: Sequence[StudyCase]) -> tuple[StudyRow, ...]:
    """Return the finished rows of `cases` in `directory`, in the order of the grid.

    Raises `InputError` for a file that holds no row.
    """
    files = {path.stem: path for path in (directory / ROWS).glob("*.json")}
    keys = [case.key for case in cases]
    return in_order(cases, {key: _row(files[key]) for key in keys if key in files})


def _row(path: Path) -> StudyRow:
    """Return the row in the file `path`, without its values: the case has them."""
    try:
        row = _ROW.validate_json(read_bytes(path, MAX_BYTES, "a row of a study"))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        told = f"{place_of(first['loc'])}: {first['msg']}".removeprefix(": ")
        raise InputError(f"{path}: no row of a study: {told}; remove it") from None
    return replace(row, values={})


def table(rows: Sequence[StudyRow]) -> str:
    """Return the rows as CSV: varied keys, scheme, seed, what came out, and the error if any."""
    varied = dict.fromkeys(key for row in rows for key in row.values)
    out = io.StringIO()
    writer = csv.DictWriter(out, [*varied, *_RESULTS], lineterminator="\n")
    writer.writeheader()
    writer.writerows(as_dict(row) for row in rows)
    return out.getvalue()


def in_order(cases: Sequence[StudyCase], rows: Mapping[str, StudyRow]) -> tuple[StudyRow, ...]:
    """Return the rows of `cases` that there are, by their keys, in the order of the grid.

    Cases of several values may be the same plan, and so have the same key.
    """
    return tuple(
        replace(rows[case.key], values=dict(case.values), scheme=case.scheme, seed=case.seed)
        for case in cases
        if case.key in rows
    )


def averaged(values: Sequence[float]) -> tuple[float, float]:
    """Return mean and standard deviation of `values`, 0 of a single one."""
    return fmean(values), stdev(values) if len(values) > 1 else 0.0


def unit_of_data(rows: Sequence[StudyRow]) -> str:
    """Return the unit of the `data` of `rows`, all with a bandwidth or all without."""
    return "bit/Hz" if all(row.delivered_mbytes is None for row in rows) else "megabytes"


def comparison(rows: Sequence[StudyRow], *, data: bool = False) -> str:
    """Return tables for people, of R_avg, of what is delivered, and of `data`; and what failed.

    Values are down, schemes across, each cell has mean and spread over the seeds.
    """
    of_rate = " of mutual information" if all(row.rate != "cutoff" for row in rows) else ""
    units = dict.fromkeys(("R_avg", "delivered"), f"bit/s/Hz{of_rate}")
    units |= {"data": unit_of_data(rows)} if data else {}
    text = [line for measure, unit in units.items() for line in _compared(rows, measure, unit)]
    if failed := [row.error for row in rows if row.error]:
        text.append(f"{len(failed)} of {counted(len(rows), 'row')} failed, first: {failed[0]}")
    if loose := sum(row.converged is False for row in rows):
        text.append(f"{loose} of {counted(len(rows), 'row')} did not converge")
    return "\n".join(text)


def _compared(rows: Sequence[StudyRow], measure: str, unit: str) -> list[str]:
    schemes = list(dict.fromkeys(row.scheme for row in rows))
    found: dict[tuple[str, ...], dict[str, list[float]]] = {}
    for row in rows:
        # as JSON: a position is a list or a mapping, which cannot be looked up
        values = tuple(json.dumps(value).strip('"') for value in row.values.values())
        rates = found.setdefault(values, {scheme: [] for scheme in schemes})[row.scheme]
        rates += [] if (rate := getattr(row, measure)) is None else [rate]
    varied = dict.fromkeys(key for row in rows for key in row.values)
    lines = [[*(key.rsplit(".", 1)[-1] for key in varied), *schemes]]
    lines += [[*values, *map(_cell, rates.values())] for values, rates in found.items()]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    table = ("  ".join(map(str.rjust, line, widths)) for line in lines)
    return [f"{measure}, {unit}", *table]


def _cell(rates: Sequence[float]) -> str:
    if not rates:
        return "-"
    mean, deviation = averaged(rates)
    return f"{mean:.4f}" + (f" +- {deviation:.4f}" if len(rates) > 1 else "")
