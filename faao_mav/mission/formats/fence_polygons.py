"""What a polygon of a drawing means as part of a fence."""

import re

from faao_mav.errors import MissionFileError
from faao_mav.mission.fence import LatLon, Polygon

_EXCLUSION = re.compile(r"exclu|no[- _]?fly|keep[- _]?out|restricted|prohibited", re.IGNORECASE)


def is_exclusion(name: str) -> bool:
    """Return whether the `name` of a polygon says that it is one to stay out of.

    >>> is_exclusion("No-fly zone 3"), is_exclusion("Exclusion"), is_exclusion("field")
    (True, True, False)
    """
    return _EXCLUSION.search(name) is not None


def polygons_of(outline: list[LatLon], holes: list[list[LatLon]], inclusion: bool) -> list[Polygon]:
    """Return a polygon and its `holes`, which are exclusions.

    A ring whose last corner is its first one loses it. Raises `MissionFileError` for an exclusion
    with holes, which no autopilot has, and `InputError` as `Polygon` does.
    """
    if holes and not inclusion:
        raise MissionFileError("an exclusion with a hole, which no autopilot knows; cut it in two")
    rings = [(outline, inclusion), *((hole, False) for hole in holes)]
    return [
        Polygon(tuple(ring[:-1] if ring[:1] == ring[-1:] else ring), inside)
        for ring, inside in rings
    ]
