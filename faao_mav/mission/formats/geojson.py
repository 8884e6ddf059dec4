"""Fences from GeoJSON (RFC 7946): its polygons, alone, in features or in collections."""

from collections.abc import Iterator
from typing import Any

from faao_mav.errors import InputError, MissionFileError, place_of, quote
from faao_mav.mission.fence import Fence, LatLon, Polygon
from faao_mav.mission.formats.fence_polygons import is_exclusion, polygons_of
from faao_mav.mission.formats.strict_json import parse_json

_WORDS = ("name", "type", "fence", "class", "title")
"""Properties of a feature that may say that it is an exclusion."""


def read_geojson_fence(text: str, source: str) -> Fence:
    """Return the polygons of `text`; geometries that are no polygons are passed over.

    A feature is an exclusion where its property `inclusion` is false, or one of `_WORDS` says so.
    Raises `MissionFileError` that names `source`, key and value.
    """
    try:
        return Fence(tuple(_polygons(parse_json(text), [], True)))
    except InputError as error:
        raise MissionFileError(f"{source}: {error}") from None


def _polygons(value: Any, steps: list[str | int], inclusion: bool) -> Iterator[Polygon]:
    """Yield the polygons of an object of GeoJSON, which stands at `steps` of the file."""
    kind = value.get("type") if isinstance(value, dict) else None
    match kind:
        case "FeatureCollection":
            for n, each in enumerate(_list(value, "features", steps)):
                yield from _polygons(each, [*steps, "features", n], inclusion)
        case "Feature":
            if value.get("geometry") is not None:
                inside = _inclusion(value.get("properties"), [*steps, "properties"])
                yield from _polygons(value["geometry"], [*steps, "geometry"], inside)
        case "GeometryCollection":
            for n, each in enumerate(_list(value, "geometries", steps)):
                yield from _polygons(each, [*steps, "geometries", n], inclusion)
        case "Polygon":
            yield from _polygon(_list(value, "coordinates", steps), steps, inclusion)
        case "MultiPolygon":
            for n, each in enumerate(_list(value, "coordinates", steps)):
                yield from _polygon(each, [*steps, "coordinates", n], inclusion)
        case "Point" | "MultiPoint" | "LineString" | "MultiLineString":
            return
        case _:
            raise _error([*steps, "type"], kind, "a type of GeoJSON, as FeatureCollection")


def _inclusion(properties: Any, steps: list[str | int]) -> bool:
    if not isinstance(properties, dict):
        return True
    told = properties.get("inclusion")
    if told is None:
        words = (properties.get(key) for key in _WORDS)
        return not any(isinstance(word, str) and is_exclusion(word) for word in words)
    if not isinstance(told, bool):
        raise _error([*steps, "inclusion"], told, "true or false")
    return told


def _polygon(rings: Any, steps: list[str | int], inclusion: bool) -> list[Polygon]:
    if not (isinstance(rings, list) and rings):
        raise _error(steps, rings, "a list of rings")
    outline, *holes = [
        [_place(place, [*steps, k, n]) for n, place in enumerate(_ring(ring, [*steps, k]))]
        for k, ring in enumerate(rings)
    ]
    try:
        return polygons_of(outline, holes, inclusion)
    except InputError as error:
        raise MissionFileError(f"{place_of(steps)}: {error}".removeprefix(": ")) from None


def _ring(ring: Any, steps: list[str | int]) -> list[Any]:
    if not isinstance(ring, list):
        raise _error(steps, ring, "a list of positions")
    return ring


def _place(place: Any, steps: list[str | int]) -> LatLon:
    numbers = isinstance(place, list) and [
        each for each in place if isinstance(each, int | float) and not isinstance(each, bool)
    ]
    if not numbers or len(numbers) != len(place) or not 2 <= len(place) <= 3:
        raise _error(steps, place, "[longitude, latitude] in degrees")
    longitude, latitude = numbers[:2]
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise _error(steps, place, "[longitude, latitude] in degrees")
    return float(latitude), float(longitude)


def _list(value: dict[str, Any], key: str, steps: list[str | int]) -> list[Any]:
    found = value.get(key)
    if not isinstance(found, list):
        raise _error([*steps, key], found, "a list")
    return found


def _error(steps: list[str | int], value: object, expected: str) -> MissionFileError:
    return MissionFileError(f"{place_of(steps)}: {quote(value)}; expected {expected}")
