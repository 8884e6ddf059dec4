"""Tables of numbers (CSV): their columns by the names in the header."""

from collections.abc import Sequence

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError, quote


def read_columns(
    text: str, path: object, groups: Sequence[Sequence[str]], more: Sequence[str] = ()
) -> tuple[list[int], dict[str, Real]]:
    r"""Return the lines at which the rows stand, and the columns.

    Those are one of each of the `groups` of names, and those of `more` that are there; others, and
    lines that begin with #, are passed over. `path` names the table. Raises `InputError` for a
    header without them, and for what is no number.

    >>> read_columns("snr_db,name,bits\n4,BPSK,0.5\n", "t.csv", [["snr_db"], ["bits", "rate"]])
    ([2], {'snr_db': array([4.]), 'bits': array([0.5])})
    """
    rows = [
        (number, [cell.strip().strip('"').strip() for cell in line.split(",")])
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    first, header = rows[0] if rows else (1, [])
    names = [name.lower() for name in header]
    known = [name for name in [*(n for group in groups for n in group), *more] if name in names]
    if any(sum(name in known for name in group) != 1 for group in groups):
        raise InputError(
            f"{path}: line {first}: columns {quote(', '.join(names))}; give a header with "
            f"{' and '.join(' or '.join(group) for group in groups)}"
        )
    at = {name: names.index(name) for name in known}
    values = np.empty((len(known), len(rows) - 1))
    for k, (number, cells) in enumerate(rows[1:]):
        for i, (name, column) in enumerate(at.items()):
            cell = cells[column] if column < len(cells) else ""
            try:
                values[i, k] = float(cell)
            except ValueError:
                raise InputError(
                    f"{path}: line {number}: {name}: {quote(cell)} is no number"
                ) from None
    return [number for number, _ in rows[1:]], dict(zip(known, values, strict=True))
