"""The rows of a study: kept as they finish, as a table, and side by side."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

from faao_mav.errors import InputError
from faao_mav.files import write_whole
from faao_mav.study.sweep import StudyCase, Value

ROWS, TABLE = "rows.jsonl", "table.csv"
_BEGINNING = b'{"key": "'
"""How the line of every row begins: a last line without an end that does not is no row cut off."""


@dataclass(frozen=True, slots=True)
class StudyRow:
    """What one case of a study led to.

    Rates and mutual information are bit/s/Hz, and `rate` names that which R_avg and all others are
    of, `optimizer.rate`; `delivered` is the delivered rate and
    `delivered_mbytes` what a flight carries, 10^6 bytes, None without a bandwidth. `seconds` is the
    time of the optimiser. Where there is no result `error` says why and the numbers are None.
    `route` is w (n, 2), m, one pair for each slot.
    """

    key: str
    values: Mapping[str, Value]
    scheme: str
    seed: int
    R_avg: float | None = None
    R_U: float | None = None
    R_G: float | None = None
    delivered: float | None = None
    delivered_mbytes: float | None = None
    mutual_information: float | None = None
    rate: str = "cutoff"
    seconds: float | None = None
    iterations: int | None = None
    converged: bool | None = None
    error: str = ""
    route: Sequence[Sequence[float]] = ()


_RESULTS = (
    *("scheme", "seed", "R_avg", "R_U", "R_G", "delivered", "delivered_mbytes"),
    *("mutual_information", "rate", "seconds", "iterations", "converged", "error"),
)
"""The fields of a row that are columns of the table."""


def as_dict(row: StudyRow) -> dict[str, Any]:
    """Return `row` as an object of `--json`: varied keys, then the columns of the table."""
    return {**row.values, **{name: getattr(row, name) for name in _RESULTS}}


def append_row(row: StudyRow, directory: Path) -> None:
    """Add `row` to the directory's rows by one write: another reader sees all of it or nothing.

    Raises `InputError`.
    """
    line = json.dumps(asdict(row), allow_nan=False) + "\n"
    path = directory / ROWS
    try:
        with path.open("ab", buffering=0) as file:
            file.write(line.encode())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def load_rows(directory: Path) -> dict[str, StudyRow]:
    """Return the finished rows in `directory` by key.

    A last line that was cut off when the machine stopped is dropped from the file. Raises
    `InputError` for anything else that is no row.
    """
    path = directory / ROWS
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    whole = content[: content.rfind(b"\n") + 1]
    rest = content[len(whole) :]
    if not (rest.startswith(_BEGINNING) or _BEGINNING.startswith(rest)):
        raise InputError(f"{path}: its last line is no row of a study; give another directory")
    if rest:
        write_whole(path, whole)
    rows: dict[str, StudyRow] = {}
    names = {field.name for field in fields(StudyRow)}
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            data = json.loads(line)
            if set(data) | {"rate"} != names:  # older rows lack it
                raise ValueError
            rows[data["key"]] = StudyRow(**data)
        except (ValueError, TypeError):
            raise InputError(
                f"{path}: line {number}: no row of a study; give another directory"
            ) from None
    return rows


def table(rows: Sequence[StudyRow]) -> str:
    """Return the rows as CSV: varied keys, scheme, seed, what came out, and the error if any."""
    varied = list(dict.fromkeys(key for row in rows for key in row.values))
    out = io.StringIO()
    writer = csv.DictWriter(out, [*varied, *_RESULTS], lineterminator="\n")
    writer.writeheader()
    writer.writerows(as_dict(row) for row in rows)
    return out.getvalue()


def in_order(cases: Sequence[StudyCase], rows: Mapping[str, StudyRow]) -> tuple[StudyRow, ...]:
    """Return the rows of `cases` that there are, in the order of the grid."""
    return tuple(rows[case.key] for case in cases if case.key in rows)


MEASURES = ("R_avg", "delivered")
"""The fields of a row that are compared."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and standard deviation (0 of a single seed) of a rate, bit/s/Hz, over `count` seeds."""

    mean: float
    deviation: float
    count: int


def spreads(
    rows: Sequence[StudyRow], measure: str
) -> dict[tuple[tuple[Value, ...], str], Spread | None]:
    """Return the spread of `measure`, one of `MEASURES`, over seeds by values and scheme, in order.

    None: all failed.
    """
    groups: dict[str, tuple[tuple[tuple[Value, ...], str], list[float]]] = {}
    for row in rows:
        place = (tuple(row.values.values()), row.scheme)
        _, rates = groups.setdefault(json.dumps(place), (_hashable(place), []))
        rate = getattr(row, measure)
        if rate is not None:
            rates.append(rate)
    return {
        place: Spread(fmean(rates), stdev(rates) if len(rates) > 1 else 0.0, len(rates))
        if rates
        else None
        for place, rates in groups.values()
    }


def _hashable(place: tuple[tuple[Value, ...], str]) -> tuple[tuple[Value, ...], str]:
    """Positions are lists in a plan; tuples can be looked up."""
    values, scheme = place
    return tuple(tuple(v) if isinstance(v, list) else v for v in values), scheme


def comparison(rows: Sequence[StudyRow]) -> str:
    """Return tables for people, of R_avg and of what is delivered, and what failed.

    Values are down, schemes across, each cell has mean and spread.
    """
    text = [line for measure in MEASURES for line in _compared(rows, measure)]
    failed = [row for row in rows if row.error]
    if failed:
        text.append(f"{len(failed)} of {len(rows)} rows failed, first: {failed[0].error}")
    loose = sum(row.converged is False for row in rows)
    if loose:
        text.append(f"{loose} of {len(rows)} rows did not converge")
    return "\n".join(text)


def _compared(rows: Sequence[StudyRow], measure: str) -> list[str]:
    varied = list(dict.fromkeys(key for row in rows for key in row.values))
    schemes = list(dict.fromkeys(row.scheme for row in rows))
    found = spreads(rows, measure)
    lines = [[*(key.rsplit(".", 1)[-1] for key in varied), *schemes]]
    for values in dict.fromkeys(values for values, _ in found):
        cells = (_cell(found.get((values, scheme))) for scheme in schemes)
        lines.append([*(json.dumps(v).strip('"') for v in values), *cells])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    of_rate = " of mutual information" if all(row.rate != "cutoff" for row in rows) else ""
    return [
        f"{measure}, bit/s/Hz{of_rate}",
        *(
            "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
            for line in lines
        ),
    ]


def _cell(spread: Spread | None) -> str:
    if spread is None:
        return "-"
    return f"{spread.mean:.4f}" + (f" +- {spread.deviation:.4f}" if spread.count > 1 else "")
