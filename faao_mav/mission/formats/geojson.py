"""Zones from GeoJSON (RFC 7946): its polygons, alone, in features or in collections."""

from collections.abc import Iterator
from typing import Any

from faao_mav.errors import MissionFileError, place_of, quote
from faao_mav.mission.fence import LatLon
from faao_mav.mission.formats.drawn_zones import DrawnZone, Ring
from faao_mav.mission.formats.strict_json import parse_json

Steps = list[str | int]
"""Where in the file a value stands: keys and numbers."""

_NAMES = ("name", "title", "label", "id")
"""Properties, in any case, of which the first one given names a feature."""


def geojson_zones(text: str) -> Iterator[DrawnZone]:
    """Yield the zones of `text`; geometries that are no polygons are passed over.

    The polygons of a MultiPolygon are one zone. Raises `MissionFileError` that names key and value.
    """
    yield from _zones(parse_json(text), [], {}, ())


def _zones(
    value: Any, steps: Steps, properties: dict[str, object], around: tuple[str, ...]
) -> Iterator[DrawnZone]:
    """Yield the zones of an object of GeoJSON, which stands at `steps` of the file."""
    kind = value.get("type") if isinstance(value, dict) else None
    match kind:
        case "FeatureCollection":
            name = value.get("name")
            inside = (*around, name) if isinstance(name, str) else around
            for n, each in enumerate(_list(value, "features", steps)):
                yield from _zones(each, [*steps, "features", n], {}, inside)
        case "Feature":
            if value.get("geometry") is not None:
                told = value.get("properties")
                own = told if isinstance(told, dict) else {}
                yield from _zones(value["geometry"], [*steps, "geometry"], own, around)
        case "GeometryCollection":
            for n, each in enumerate(_list(value, "geometries", steps)):
                yield from _zones(each, [*steps, "geometries", n], properties, around)
        case "Polygon" | "MultiPolygon":
            coordinates, here = _list(value, "coordinates", steps), [*steps, "coordinates"]
            several = kind == "MultiPolygon"
            parts = enumerate(coordinates) if several else [(None, coordinates)]
            yield DrawnZone(
                place_of(steps) or "the polygon",
                _name(properties),
                properties,
                around,
                [_rings(part, here if n is None else [*here, n]) for n, part in parts],
            )
        case "Point" | "MultiPoint" | "LineString" | "MultiLineString":
            return
        case _:
            raise _error([*steps, "type"], kind, "a type of GeoJSON, as FeatureCollection")


def _name(properties: dict[str, object]) -> str:
    folded = {key.casefold(): value for key, value in properties.items()}
    return next((str(folded[key]) for key in _NAMES if folded.get(key) not in (None, "")), "")


def _rings(rings: Any, steps: Steps) -> list[Ring]:
    """Return an outline and its holes; none for an empty part, which RFC 7946 allows."""
    if not isinstance(rings, list):
        raise _error(steps, rings, "a list of rings")
    return [
        [_place(place, [*steps, k, n]) for n, place in enumerate(_ring(ring, [*steps, k]))]
        for k, ring in enumerate(rings)
    ]


def _ring(ring: Any, steps: Steps) -> list[Any]:
    if not isinstance(ring, list):
        raise _error(steps, ring, "a list of positions")
    return ring


def _place(place: Any, steps: Steps) -> LatLon:
    numbers = isinstance(place, list) and [
        each for each in place if isinstance(each, int | float) and not isinstance(each, bool)
    ]
    if not numbers or len(numbers) != len(place) or not 2 <= len(place) <= 3:
        raise _error(steps, place, "[longitude, latitude] in degrees")
    longitude, latitude = numbers[:2]
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise _error(steps, place, "[longitude, latitude] in degrees")
    return float(latitude), float(longitude)


def _list(value: dict[str, Any], key: str, steps: Steps) -> list[Any]:
    found = value.get(key)
    if not isinstance(found, list):
        raise _error([*steps, key], found, "a list")
    return found


def _error(steps: Steps, value: object, expected: str) -> MissionFileError:
    return MissionFileError(f"{place_of(steps)}: {quote(value)}; expected {expected}")
