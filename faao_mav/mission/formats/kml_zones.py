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
"""Levels of nesting that are read; chosen: folders in folders need some ten."""


def kml_zones(content: bytes, most: int) -> Iterator[DrawnZone]:
    """Yield the zones of a KML file, or of a KMZ archive that holds one of at most `most` bytes.

    Placemarks without polygons are passed over.

    The polygons of a placemark are one zone; its name, description and ExtendedData, and the names
    of the folders around it, say which kind. Raises `MissionFileError` that names the placemark.
    """
    zipped = content.startswith(b"PK\x03\x04")
    yield from _zones(_tree(_unzipped(content, most) if zipped else content), (), _MAX_DEPTH)


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
    """Return the elements of `content`, whose tags keep their prefixes, declared or not."""
    builder = Xml.TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
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


def _zones(element: Xml.Element, around: tuple[str, ...], depth: int) -> Iterator[DrawnZone]:
    """Yield the zones below `element`, which is in what is named `around`."""
    if depth == 0:
        raise MissionFileError(f"nested more than {_MAX_DEPTH} deep")
    if _tag(element) == "Placemark":
        yield from _placemark(element, around, depth)
        return
    own = _text(element, "name")
    inside = (*around, own) if own else around
    for each in element:
        yield from _zones(each, inside, depth - 1)


def _placemark(element: Xml.Element, around: tuple[str, ...], depth: int) -> Iterator[DrawnZone]:
    polygons = list(_polygons(element, depth))
    if not polygons:
        return
    name = _text(element, "name")
    place = f"polygon {quote(name)}" if name else "a polygon without a name"
    properties: dict[str, object] = {"description": _text(element, "description")}
    for data in element.iter():
        key = data.get("name")
        if key is not None and _tag(data) == "Data":
            properties[key] = _text(data, "value")
        elif key is not None and _tag(data) == "SimpleData":
            properties[key] = (data.text or "").strip()
    yield DrawnZone(place, name, properties, around, [_rings(each, place) for each in polygons])


def _polygons(element: Xml.Element, depth: int) -> Iterator[Xml.Element]:
    """Yield the polygons in a placemark, those of geometries in geometries too."""
    if depth == 0:
        raise MissionFileError(f"nested more than {_MAX_DEPTH} deep")
    if _tag(element) == "Polygon":
        yield element
        return
    for each in element:
        yield from _polygons(each, depth - 1)


def _rings(polygon: Xml.Element, place: str) -> list[Ring]:
    """Return the outline of a polygon and its holes; none for a polygon without an outline."""
    outlines = list(_boundaries(polygon, "outerBoundaryIs", place))
    if len(outlines) > 1:
        raise MissionFileError(f"{place}: expected one outerBoundaryIs")
    return [*outlines, *_boundaries(polygon, "innerBoundaryIs", place)] if outlines else []


def _boundaries(polygon: Xml.Element, boundary: str, place: str) -> Iterator[Ring]:
    for side in polygon:
        if _tag(side) == boundary:
            for ring in side:
                if _tag(ring) == "LinearRing":
                    yield [_corner(each, place) for each in _text(ring, "coordinates").split()]


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
    return next(((each.text or "").strip() for each in element if _tag(each) == tag), "")


def _tag(element: Xml.Element) -> str:
    """Return the name of an element without its prefix, which differs from writer to writer."""
    return str(element.tag).rpartition(":")[2]
