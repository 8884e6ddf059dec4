"""What a plan names by a file that lies beside it, put in its place."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from faao_mav.errors import PlanError, quote
from faao_mav.files import read_text
from faao_mav.plan.fields import listed
from faao_mav.plan.yaml_text import load_yaml

MAX_CHARACTERS = 1_000_000
"""Characters of the longest file that is read; chosen: a law of the gain has 500."""

_SNR, _RATES = "snr_db", ("mbit_per_s", "bit_per_s_per_hz")


def read_rates(text: str, path: str) -> dict[str, list[float]]:
    """Return the columns of a table of rates; others, and lines that begin with #, are passed over.

    Raises `PlanError` for a table without them, and for what is no number.
    """
    rows = [
        (number, [cell.strip().strip('"').strip() for cell in line.split(",")])
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    number, header = rows[0] if rows else (1, [])
    names = [name.lower() for name in header]
    known = [name for name in (_SNR, *_RATES) if name in names]
    if len(known) != 2 or _SNR not in known:
        raise PlanError(
            f"{path}: line {number}: columns {quote(', '.join(names))}; give a header with {_SNR} "
            f"and {listed(_RATES)}"
        )
    found: dict[str, list[float]] = {name: [] for name in known}
    for number, cells in rows[1:]:
        for name in known:
            cell = dict(zip(names, cells, strict=False)).get(name, "")
            try:
                found[name].append(float(cell))
            except ValueError:
                raise PlanError(
                    f"{path}: line {number}: {name}: {quote(cell)} is no number"
                ) from None
    return found


_FILES = (
    (("radio", "gain"), load_yaml),
    (("radio", "base_station", "gain"), load_yaml),
    (("radio", "ground_user", "gain"), load_yaml),
    (("radio", "rates"), read_rates),
)
"""Keys whose value may be the name of a file with what stands there otherwise, and how it is read:
from its text, and its name for messages."""


def filled_in(data: dict[str, Any], source: str) -> Iterator[tuple[tuple[str, ...], str]]:
    """Put what is in the files that the plan `data` names into their places; yield keys and files.

    Names are relative to the plan's file `source`. Raises `PlanError` for a file that cannot be
    read.
    """
    for keys, read in _FILES:
        section: Any = data
        for step in keys[:-1]:
            section = section.get(step) if isinstance(section, dict) else None
        if isinstance(section, dict) and isinstance(name := section.get(keys[-1]), str):
            path = str(Path(source).parent / name)
            try:
                section[keys[-1]] = read(read_text(path, MAX_CHARACTERS, "text", PlanError), path)
            except PlanError as error:
                raise PlanError(f"{source}: {'.'.join(keys)}: {error}") from None
            yield keys, path
