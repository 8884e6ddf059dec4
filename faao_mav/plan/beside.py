"""What a plan names by a file that lies beside it, put in its place."""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from faao_mav.errors import InputError, PlanError
from faao_mav.files import read_columns, read_text
from faao_mav.plan.station import read_track
from faao_mav.plan.yaml_text import load_yaml
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
        place, folder = f"{source}: {'.'.join(keys)}", Path(source).parent
        try:
            section, key = _holder(data, keys), keys[-1]
            if path := _file(section.get(key), folder):
                section[key] = read(read_text(path, MAX_CHARACTERS, "text", PlanError), str(path))
                yield keys, str(path)
                place, folder = f"{place}: {path}: map", path.parent
            else:
                place = f"{place}.map"
            law = _holder(data, (*keys, "map"))
            if path := _file(law.get("map"), folder):
                law["map"] = _word(path, _version(path))
                yield (*keys, "map"), str(path)
        except InputError as error:
            raise PlanError(f"{place}: {error}") from None


def _version(path: Path) -> tuple[int, int] | None:
    """Return what tells a file from what it was before; None where it cannot be read."""
    try:
        told = path.stat()
    except (OSError, ValueError):
        return None
    return told.st_mtime_ns, told.st_size


@lru_cache(maxsize=8)
def _word(path: Path, version: tuple[int, int] | None) -> str:
    """Return the word of a map's file: the page reads its plan anew at every change of it."""
    del version
    return map_word(read_map(path))


def _holder(data: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    """Return the mapping in `data` that has the last of `keys`; an empty one for none."""
    for step in keys[:-1]:
        inside = data.get(step)
        data = inside if isinstance(inside, dict) else {}
    return data


def _file(name: object, folder: Path) -> Path | None:
    """Return the file of that `name`; None for a value that is the content of one."""
    if not isinstance(name, str) or "\n" in name or name.startswith(WORD):
        return None
    return folder / name
