"""The rows of a study: kept as they finish, and as a table."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from faao_mav.errors import InputError
from faao_mav.files import write_whole
from faao_mav.study.sweep import Case, Value

ROWS, TABLE = "rows.jsonl", "table.csv"
_BEGINNING = b'{"key": "'  # of every row: what is cut off must not be somebody's text


@dataclass(frozen=True, slots=True)
class Row:
    """What one case of a study led to: rates in bit/s/Hz, `seconds` of the optimiser.

    Without a result `error` says why and the numbers are None. `route` is w (n, 2), m, one pair
    for each slot.
    """

    key: str
    values: Mapping[str, Value]
    scheme: str
    seed: int
    R_avg: float | None = None
    R_U: float | None = None
    R_G: float | None = None
    mutual_information: float | None = None
    seconds: float | None = None
    iterations: int | None = None
    converged: bool | None = None
    error: str = ""
    route: Sequence[Sequence[float]] = ()


_RESULTS = (
    *("scheme", "seed", "R_avg", "R_U", "R_G", "mutual_information"),
    *("seconds", "iterations", "converged", "error"),
)


def as_dict(row: Row) -> dict[str, Any]:
    """Return `row` for people's programs: varied keys, then the columns of the table."""
    return {**row.values, **{name: getattr(row, name) for name in _RESULTS}}


def append_row(row: Row, directory: Path) -> None:
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


def load_rows(directory: Path) -> dict[str, Row]:
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
    rows: dict[str, Row] = {}
    names = {field.name for field in fields(Row)}
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            data = json.loads(line)
            if set(data) != names:
                raise ValueError
            rows[data["key"]] = Row(**data)
        except (ValueError, TypeError):
            raise InputError(
                f"{path}: line {number}: no row of a study; give another directory"
            ) from None
    return rows


def table(rows: Sequence[Row]) -> str:
    """Return the rows as CSV: varied keys, scheme, seed, what came out, and the error if any."""
    varied = list(dict.fromkeys(key for row in rows for key in row.values))
    out = io.StringIO()
    writer = csv.DictWriter(out, [*varied, *_RESULTS], lineterminator="\n")
    writer.writeheader()
    writer.writerows(as_dict(row) for row in rows)
    return out.getvalue()


def in_order(cases: Sequence[Case], rows: Mapping[str, Row]) -> tuple[Row, ...]:
    """Return the rows of `cases` that there are, in the order of the grid."""
    return tuple(rows[case.key] for case in cases if case.key in rows)
