"""Fences from KML: the polygons of its placemarks.

Source: OGC KML 2.3 (07-147r2), Polygon.
"""

from collections.abc import Iterator
from xml.etree import ElementTree as Xml

from faao_mav.errors import InputError, MissionFileError, quote
from faao_mav.mission.fence import Fence, LatLon, Polygon
from faao_mav.mission.formats.fence_polygons import is_exclusion, polygons_of

_MAX_DEPTH = 50
"""Levels of nesting that are read; chosen: folders in folders need some ten."""


def read_kml_fence(text: str, source: str) -> Fence:
    """Return the polygons of `text`; placemarks without polygons are passed over.

    A polygon is an exclusion where the name of its placemark, or of a folder around it, says so.
    Raises `MissionFileError` that names `source` and the placemark.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:  # KML has none, and entities may grow
        raise MissionFileError(f"{source}: a document type or entities; expected plain KML")
    try:
        tree = Xml.fromstring(text)
    except (Xml.ParseError, ValueError) as error:
        raise MissionFileError(f"{source}: not XML: {error}") from None
    try:
        return Fence(tuple(_polygons(tree, "", True, _MAX_DEPTH)))
    except InputError as error:
        raise MissionFileError(f"{source}: {error}") from None


def _polygons(element: Xml.Element, name: str, inclusion: bool, depth: int) -> Iterator[Polygon]:
    """Yield the polygons below `element`, the nearest name around which is `name`."""
    if depth == 0:
        raise MissionFileError(f"nested more than {_MAX_DEPTH} deep")
    own = _text(element, "name").strip()
    name, inclusion = own or name, inclusion and not is_exclusion(own)
    if _tag(element) == "Polygon":
        outlines = list(_rings(element, "outerBoundaryIs", name))
        if len(outlines) != 1:
            raise MissionFileError(f"polygon {quote(name)}: expected one outerBoundaryIs")
        holes = list(_rings(element, "innerBoundaryIs", name))
        try:
            yield from polygons_of(outlines[0], holes, inclusion)
        except InputError as error:
            raise MissionFileError(f"polygon {quote(name)}: {error}") from None
        return
    for each in element:
        yield from _polygons(each, name, inclusion, depth - 1)


def _rings(polygon: Xml.Element, boundary: str, name: str) -> Iterator[list[LatLon]]:
    for side in polygon:
        if _tag(side) == boundary:
            for ring in side:
                if _tag(ring) == "LinearRing":
                    yield [_place(each, name) for each in _text(ring, "coordinates").split()]


def _place(told: str, name: str) -> LatLon:
    try:
        longitude, latitude = map(float, told.split(",")[:2])
    except ValueError:
        raise MissionFileError(
            f"polygon {quote(name)}: {quote(told)}; expected longitude,latitude in degrees"
        ) from None
    return latitude, longitude


def _text(element: Xml.Element, tag: str) -> str:
    return next((each.text or "" for each in element if _tag(each) == tag), "")


def _tag(element: Xml.Element) -> str:
    """Return the name of an element without its namespace, which differs from writer to writer."""
    return str(element.tag).rpartition("}")[2]
