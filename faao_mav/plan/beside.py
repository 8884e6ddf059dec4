"""What a plan names by a file that lies beside it, put in its place."""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from faao_mav.errors import InputError, PlanError
from faao_mav.files import read_text
from faao_mav.plan.station import read_track
from faao_mav.plan.yaml_text import load_yaml
from faao_mav.radio.columns import read_columns
from faao_mav.radio.map_file import WORD, map_word, read_map

MAX_CHARACTERS = 1_000_000
"""Characters of the longest file that is read; chosen: a law of the gain has 500."""

_RATES = (("snr_db", "mbit_per_s"), ("snr_db", "bit_per_s_per_hz"))
"""The columns of a table of rates."""


def read_rates(text: str, path: str) -> dict[str, list[float]]:
    """Return the columns of a table of rates; raise `PlanError` that names line and value."""
    try:
        return read_columns(text, _RATES)[1]
    except InputError as error:
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

    Names are relative to the plan's file `source`, that of a map to the file that names it. Raises
    `PlanError` for a file that cannot be read.
    """
    for keys, read in _FILES:
        section: Any = data
        for step in keys[:-1]:
            section = section.get(step) if isinstance(section, dict) else None
        if not isinstance(section, dict):
            continue
        place, folder = f"{source}: {'.'.join(keys)}", Path(source).parent
        try:
            name = section.get(keys[-1])
            if isinstance(name, str) and "\n" not in name:  # which is a file's content
                path = folder / name
                text = read_text(path, MAX_CHARACTERS, "text", PlanError)
                section[keys[-1]] = read(text, str(path))
                yield keys, str(path)
                place, folder = f"{place}: {path}", path.parent
            law = section.get(keys[-1])
            name = law.get("map") if isinstance(law, dict) else None
            if isinstance(law, dict) and isinstance(name, str) and not name.startswith(WORD):
                path = folder / name
                place = f"{place}.map" if folder == Path(source).parent else f"{place}: map"
                law["map"] = _word(path, *_version(path))
                yield (*keys, "map"), str(path)
        except InputError as error:
            raise PlanError(f"{place}: {error}") from None


def _version(path: Path) -> tuple[int, int]:
    """Return what tells a file from what it was before; zeros where it cannot be read."""
    try:
        told = path.stat()
    except (OSError, ValueError):
        return 0, 0
    return told.st_mtime_ns, told.st_size


@lru_cache(maxsize=8)
def _word(path: Path, changed: int, size: int) -> str:
    """Return the word of the map in a file: the page reads its plan anew at every change of it."""
    del changed, size
    return map_word(read_map(path))
