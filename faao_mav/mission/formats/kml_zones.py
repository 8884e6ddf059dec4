"""Zones from KML and KMZ: the polygons of its placemarks.

Source: OGC KML 2.3 (07-147r2), Polygon, ExtendedData.
"""

import io
import zipfile
import zlib
from collections.abc import Iterator
from xml.etree import ElementTree as Xml
from xml.parsers import expat

from faao_mav.errors import MissionFileError, quote
from faao_mav.mission.fence import LatLon
from faao_mav.mission.formats.drawn_zones import DrawnZone, Ring

_MAX_DEPTH = 50
"""Levels of named folders that are read; chosen: folders in folders need some ten."""


def kml_zones(content: bytes, most: int) -> Iterator[DrawnZone]:
    """Yield the zones of a KML file, or of a KMZ archive that holds one of at most `most` bytes.

    The polygons of a placemark are one zone; its name, description and ExtendedData, and the names
    of the folders around it, say which kind. Placemarks without polygons are passed over. Raises
    `MissionFileError` that names the placemark.
    """
    zipped = content.startswith(b"PK\x03\x04")
    ahead = [(_tree(_unzipped(content, most) if zipped else content), tuple[str, ...]())]
    while ahead:
        element, around = ahead.pop()
        if element.tag == "Placemark":
            yield from _zone(element, around)
            continue
        own = _text(element, "name")
        inside = (*around, own) if own else around
        if len(inside) > _MAX_DEPTH:
            raise MissionFileError(f"folders nested more than {_MAX_DEPTH} deep")
        ahead += [(each, inside) for each in reversed(element)]


def _unzipped(content: bytes, most: int) -> bytes:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = [name for name in archive.namelist() if name.casefold().endswith(".kml")]
            if not names:
                raise MissionFileError("an archive without a .kml file")
            with archive.open(names[0]) as file:
                kml = file.read(most + 1)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise MissionFileError(f"not a KMZ archive that can be read: {error}") from None
    if len(kml) > most:
        raise MissionFileError(f"{quote(names[0])} in it is larger than {most:,} bytes")
    return kml


def _tree(content: bytes) -> Xml.Element:
    """Return the elements of `content`, without prefixes, which need not be declared."""
    builder, parser = Xml.TreeBuilder(), expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        builder.start(tag.rpartition(":")[2], attributes)

    def end(tag: str) -> None:
        builder.end(tag.rpartition(":")[2])

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = _refuse_doctype
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise MissionFileError(f"not XML: {error}") from None
    return builder.close()


def _refuse_doctype(*_: object) -> None:
    """KML has no document type, and the entities of one may grow without end."""
    raise MissionFileError("a document type or entities; expected plain KML")


def _zone(placemark: Xml.Element, around: tuple[str, ...]) -> Iterator[DrawnZone]:
    """Yield the polygons of a placemark, those of geometries in geometries too, as one zone."""
    name = _text(placemark, "name")
    place = f"polygon {quote(name)}" if name else "a polygon without a name"
    properties: dict[str, object] = {"description": _text(placemark, "description")}
    for data in placemark.iter("Data"):
        properties[data.get("name", "")] = _text(data, "value")
    for data in placemark.iter("SimpleData"):
        properties[data.get("name", "")] = (data.text or "").strip()
    parts = [_rings(polygon, place) for polygon in placemark.iter("Polygon")]
    if parts:
        yield DrawnZone(place, name, properties, around, parts)


def _rings(polygon: Xml.Element, place: str) -> list[Ring]:
    """Return the outline of a polygon and its holes; none for a polygon without an outline."""
    outlines = polygon.findall("outerBoundaryIs/LinearRing")
    if len(outlines) > 1:
        raise MissionFileError(f"{place}: expected one outerBoundaryIs")
    rings = [*outlines, *polygon.findall("innerBoundaryIs/LinearRing")] if outlines else []
    return [[_corner(each, place) for each in _text(r, "coordinates").split()] for r in rings]


def _corner(told: str, place: str) -> LatLon:
    try:
        longitude, latitude = map(float, told.split(",")[:2])
    except ValueError:
        raise MissionFileError(
            f"{place}: {quote(told)}; expected longitude,latitude in degrees"
        ) from None
    return latitude, longitude


def _text(element: Xml.Element, tag: str) -> str:
    """Return the text of the first `tag` in `element`, without spaces around it."""
    return (element.findtext(tag) or "").strip()
