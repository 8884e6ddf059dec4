"""Zones from GeoJSON (RFC 7946): its polygons, alone, in features or in collections."""

from collections.abc import Iterator
from typing import Any, TypeAlias

from faao_mav.mission.fence import MAX_CORNERS, LatLon
from faao_mav.mission.formats.drawn_zones import DrawnZone, Ring
from faao_mav.mission.formats.json_value import Json

Ahead: TypeAlias = tuple[Json, dict[str, Any], tuple[str, ...]]
"""An object of the file, the properties of its feature, and the names of what it is in."""

_NAMES = ("name", "title", "label", "id")
"""Properties, in any case, of which the first one given names a feature."""


def geojson_zones(text: str) -> Iterator[DrawnZone]:
    """Yield the zones of `text`; geometries that are no polygons are passed over.

    The polygons of a MultiPolygon are one zone. Raises `MissionFileError` that names key and value.
    """
    ahead: list[Ahead] = [(Json.parsed(text), {}, ())]
    while ahead:
        value, properties, around = ahead.pop()
        match value["type"].value:
            case "FeatureCollection":
                name = value.value.get("name")
                inside = (*around, name) if isinstance(name, str) else around
                ahead += [(each, {}, inside) for each in reversed(value["features"].each())]
            case "Feature":
                told = value.value.get("properties")
                if (geometry := value.get("geometry")) is not None:
                    ahead.append((geometry, told if isinstance(told, dict) else {}, around))
            case "GeometryCollection":
                inner = reversed(value["geometries"].each())
                ahead += [(each, properties, around) for each in inner]
            case "Polygon" | "MultiPolygon" as kind:
                coordinates = value["coordinates"]
                parts = coordinates.each() if kind == "MultiPolygon" else [coordinates]
                place = value.place or "the polygon"
                rings = [_rings(part) for part in parts]
                yield DrawnZone(place, _name(properties), properties, around, rings)
            case "Point" | "MultiPoint" | "LineString" | "MultiLineString":
                continue
            case _:
                raise value["type"].wrong("a type of GeoJSON, as FeatureCollection")


def _name(properties: dict[str, Any]) -> str:
    folded = {key.casefold(): value for key, value in properties.items()}
    return next((str(folded[key]) for key in _NAMES if folded.get(key) not in (None, "")), "")


def _rings(part: Json) -> list[Ring]:
    """Return an outline and its holes; none for an empty part, which RFC 7946 allows."""
    return [[_corner(place) for place in ring.each(MAX_CORNERS + 1)] for ring in part.each()]


def _corner(place: Json) -> LatLon:
    if not isinstance(place.value, list) or len(place.value) not in (2, 3):
        raise place.wrong("[longitude, latitude] in degrees")
    longitude, latitude, *_ = place.numbers(len(place.value))
    return latitude, longitude
