"""What a plan names by a file that lies beside it, put in its place."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from faao_mav.errors import PlanError
from faao_mav.files import read_text
from faao_mav.plan.columns import read_columns
from faao_mav.plan.station import read_track
from faao_mav.plan.yaml_text import load_yaml

MAX_CHARACTERS = 1_000_000
"""Characters of the longest file that is read; chosen: a law of the gain has 500."""

_RATES = (("snr_db", "mbit_per_s"), ("snr_db", "bit_per_s_per_hz"))
"""The columns of a table of rates."""


def read_rates(text: str, path: str) -> dict[str, list[float]]:
    """Return the columns of a table of rates; raise `PlanError` that names line and value."""
    try:
        return read_columns(text, _RATES)[1]
    except PlanError as error:
        raise PlanError(f"{path}: {error}") from None


_FILES = (
    (("radio", "gain"), load_yaml),
    (("radio", "base_station", "gain"), load_yaml),
    (("radio", "ground_user", "gain"), load_yaml),
    (("radio", "base_station", "track"), read_track),
    (("radio", "ground_user", "track"), read_track),
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
        name = section.get(keys[-1]) if isinstance(section, dict) else None
        if isinstance(name, str) and "\n" not in name:  # which is a file's content
            path = str(Path(source).parent / name)
            try:
                section[keys[-1]] = read(read_text(path, MAX_CHARACTERS, "text", PlanError), path)
            except PlanError as error:
                raise PlanError(f"{source}: {'.'.join(keys)}: {error}") from None
            yield keys, path
