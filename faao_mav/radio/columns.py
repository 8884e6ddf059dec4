"""Columns of numbers in text with commas (CSV)."""

from collections.abc import Sequence

from faao_mav.errors import InputError, quote


def read_columns(
    text: str, choices: Sequence[tuple[str, ...]], more: Sequence[str] = ()
) -> tuple[list[int], dict[str, list[float]]]:
    r"""Return the line number of each row, and the columns by name of that one of `choices` it has.

    Those of `more` that there are come too; others, and lines that begin with #, are passed over.
    Raises `InputError` that names the line for a header without one of the `choices`, or with
    several, and for what is no number.

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
        wanted = ", or ".join(f"{', '.join(choice[:-1])} and {choice[-1]}" for choice in choices)
        raise InputError(
            f"line {number}: columns {quote(', '.join(names))}; give a header with {wanted}"
        )
    at = {name: names.index(name) for name in (*held[0], *more) if name in names}
    found: dict[str, list[float]] = {name: [] for name in at}
    for number, cells in rows[1:]:
        for name, column in at.items():
            cell = cells[column] if column < len(cells) else ""
            try:
                found[name].append(float(cell))
            except ValueError:
                raise InputError(f"line {number}: {name}: {quote(cell)} is no number") from None
    return [number for number, _ in rows[1:]], found
