"""What a plan names by a file that lies beside it, put in its place."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from faao_mav.errors import PlanError
from faao_mav.files import read_text
from faao_mav.plan.yaml_text import load_yaml

_MAX_CHARACTERS = 1_000_000
"""Characters of the longest file that is read; chosen: a law of the gain has 500."""

_FILES = (("radio", "gain"), ("radio", "base_station", "gain"), ("radio", "ground_user", "gain"))
"""Keys whose value may be the name of a file with the mapping that stands there otherwise."""


def filled_in(data: dict[str, Any], source: str) -> Iterator[tuple[tuple[str, ...], str]]:
    """Put what is in the files that the plan `data` names into their places; yield keys and files.

    Names are relative to the plan's file `source`. Raises `PlanError` for a file that cannot be
    read.
    """
    for *above, last in _FILES:
        section: Any = data
        for step in above:
            section = section.get(step) if isinstance(section, dict) else None
        if isinstance(section, dict) and isinstance(name := section.get(last), str):
            path = str(Path(source).parent / name)
            try:
                section[last] = load_yaml(read_text(path, _MAX_CHARACTERS, "text", PlanError), path)
            except PlanError as error:
                raise PlanError(f"{source}: {'.'.join((*above, last))}: {error}") from None
            yield (*above, last), path
