"""Columns of numbers in text with commas (CSV)."""

from collections.abc import Sequence

from faao_mav.errors import PlanError, quote
from faao_mav.plan.fields import listed


def read_columns(
    text: str, choices: Sequence[tuple[str, ...]]
) -> tuple[list[int], dict[str, list[float]]]:
    r"""Return the line number of each row, and the columns by name of that one of `choices` it has.

    Other columns, and lines that begin with #, are passed over. Raises `PlanError` that names the
    line for a header without one of the `choices`, or with several, and for what is no number.

    >>> read_columns("time_s,east_m\n0,5\n", [("time_s", "east_m")])
    ([2], {'time_s': [0.0], 'east_m': [5.0]})
    """
    rows = [
        (number, [cell.strip().strip('"').strip() for cell in line.split(",")])
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    number, header = rows[0] if rows else (1, [])
    names = [name.lower() for name in header]
    held = [choice for choice in choices if set(choice) <= set(names)]
    if len(held) != 1:
        wanted = ", or ".join(listed(choice, "and") for choice in choices)
        raise PlanError(
            f"line {number}: columns {quote(', '.join(names))}; give a header with {wanted}"
        )
    found: dict[str, list[float]] = {name: [] for name in held[0]}
    for number, cells in rows[1:]:
        for name in found:
            cell = dict(zip(names, cells, strict=False)).get(name, "")
            try:
                found[name].append(float(cell))
            except ValueError:
                raise PlanError(f"line {number}: {name}: {quote(cell)} is no number") from None
    return [number for number, _ in rows[1:]], found
