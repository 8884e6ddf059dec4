"""Fences from files: QGroundControl's `.plan`, and the zones that KML, KMZ and GeoJSON draw.

Sources: OGC KML 2.3 (07-147r2), Polygon, ExtendedData; RFC 7946.
"""

import io
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml
from xml.parsers import expat

from faao_mav.errors import MissionFileError, quote, shortened
from faao_mav.files import read_bytes, read_text
from faao_mav.mission.fence import Fence
from faao_mav.mission.formats import naming, read_mission
from faao_mav.mission.formats.drawn_zones import DrawnZone, fence_of
from faao_mav.mission.formats.json_value import Json

MAX_BYTES = 4_000_000
"""Bytes of the largest file that is read; chosen: far more than any autopilot stores."""

_MAX_DEPTH = 50
"""Levels of named folders in KML that are read; chosen: folders in folders need some ten."""

_NAMES = ("name", "title", "label", "id")
"""Properties in GeoJSON, in any case, of which the first one given names a feature."""


def read_fence(path: Path) -> Fence:
    """Return the fence in the file `path`, whose format its name's ending tells.

    Of a drawing (KML, KMZ, GeoJSON) it is the polygons, each to stay in or out of as its words
    tell: see `drawn_zones`. Raises `MissionFileError` if the ending is unknown or the file cannot
    be read, is too large, holds no fence, or leaves open what a polygon means.
    """
    match path.suffix.lower():
        case ".plan":
            fence = read_mission(path).fence
        case ".kml" | ".kmz":
            content = read_bytes(path, MAX_BYTES, "a fence", MissionFileError)
            fence = naming(path, lambda: fence_of(kml_zones(content)))
        case ".geojson" | ".json":
            text = read_text(path, MAX_BYTES, "a fence", MissionFileError)
            fence = naming(path, lambda: fence_of(geojson_zones(text)))
        case suffix:
            shown = repr(suffix) if suffix else "no ending"
            raise MissionFileError(
                f"{path}: {shown}; expected a .plan, .kml, .kmz or .geojson file"
            )
    if not fence:
        raise MissionFileError(f"{path}: holds no fence; expected polygons")
    return fence


def geojson_zones(text: str) -> Iterator[DrawnZone]:
    """Yield the zones of GeoJSON; geometries that are no polygons are passed over.

    The polygons of a MultiPolygon are one zone. Raises `MissionFileError` that names key and value.
    """
    ahead = [(Json.parsed(text), dict[str, Any](), tuple[str, ...]())]
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
                coordinates = value["coordinates"].value
                folded = {key.casefold(): told for key, told in properties.items()}
                named = (folded[key] for key in _NAMES if folded.get(key) not in (None, ""))
                place, name = value.place or "the polygon", str(next(named, ""))
                parts = coordinates if kind == "MultiPolygon" else [coordinates]
                yield DrawnZone(place, name, properties, around, parts)
            case "Point" | "MultiPoint" | "LineString" | "MultiLineString":
                continue
            case _:
                raise value["type"].wrong("a type of GeoJSON, as FeatureCollection")


def kml_zones(content: bytes) -> Iterator[DrawnZone]:
    """Yield the zones of a KML file, or of a KMZ archive that holds one.

    The polygons of a placemark are one zone; its name, description and ExtendedData, and the names
    of the folders around it, say which kind. Placemarks without polygons are passed over. Raises
    `MissionFileError` that names the placemark.
    """
    zipped = content.startswith(b"PK\x03\x04")
    ahead = [(_tree(_unzipped(content) if zipped else content), tuple[str, ...]())]
    while ahead:
        element, around = ahead.pop()
        name = _text(element, "name")
        if element.tag == "Placemark":
            place = f"polygon {quote(name)}" if name else "a polygon without a name"
            properties: dict[str, object] = {"description": _text(element, "description")}
            for data in element.iter("Data"):
                properties[data.get("name", "")] = _text(data, "value")
            for data in element.iter("SimpleData"):
                properties[data.get("name", "")] = (data.text or "").strip()
            parts = [_rings(polygon, place) for polygon in element.iter("Polygon")]
            if parts:
                yield DrawnZone(place, name, properties, around, parts)
            continue
        inside = (*around, name) if name else around
        if len(inside) > _MAX_DEPTH:
            raise MissionFileError(f"folders nested more than {_MAX_DEPTH} deep")
        ahead += [(each, inside) for each in reversed(element)]


def _unzipped(content: bytes) -> bytes:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = [name for name in archive.namelist() if name.casefold().endswith(".kml")]
            if not names:
                raise MissionFileError("an archive without a .kml file")
            with archive.open(names[0]) as file:
                kml = file.read(MAX_BYTES + 1)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        told = shortened(str(error))
        raise MissionFileError(f"not a KMZ archive that can be read: {told}") from None
    if len(kml) > MAX_BYTES:
        raise MissionFileError(f"{quote(names[0])} in it is larger than {MAX_BYTES:,} bytes")
    return kml


def _tree(content: bytes) -> Xml.Element:
    """Return the elements of KML, without prefixes, which need not be declared.

    KML has no document type: one is refused, for its entities may grow without end.
    """
    builder, parser = Xml.TreeBuilder(), expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise MissionFileError("a document type or entities; expected plain KML")

    parser.buffer_text = True
    parser.StartElementHandler = lambda tag, told: builder.start(tag.rpartition(":")[2], told)
    parser.EndElementHandler = lambda tag: builder.end(tag.rpartition(":")[2])
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise MissionFileError(f"not XML: {shortened(str(error))}") from None
    return builder.close()


def _rings(polygon: Xml.Element, place: str) -> list[list[list[str]]]:
    """Return the outline of a polygon and its holes; none for a polygon without an outline."""
    outlines = polygon.findall("outerBoundaryIs/LinearRing")
    if len(outlines) > 1:
        raise MissionFileError(f"{place}: expected one outerBoundaryIs")
    rings = [*outlines, *polygon.findall("innerBoundaryIs/LinearRing")] if outlines else []
    return [[each.split(",") for each in _text(ring, "coordinates").split()] for ring in rings]


def _text(element: Xml.Element, tag: str) -> str:
    """Return the text of the first `tag` in `element`, without spaces around it."""
    return (element.findtext(tag) or "").strip()
