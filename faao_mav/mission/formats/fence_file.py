"""Fences from files: QGroundControl's `.plan`, and the polygons that KML, KMZ and GeoJSON draw.

A drawn polygon is a zone to stay in or out of, as words tell. Nobody is let fly into a zone for
want of a word: a polygon whose words tell neither, or both, is an error that says how to tell.
Sources: OGC KML 2.3 (07-147r2), Polygon, ExtendedData; RFC 7946.
"""

import io
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as Xml
from xml.parsers import expat

import shapely

from faao_mav.errors import InputError, MissionFileError, quote, shortened
from faao_mav.files import read_bytes, read_text, table
from faao_mav.mission.fence import Fence, LatLon, Polygon, check_outlines
from faao_mav.mission.formats import naming, read_mission
from faao_mav.mission.formats.json_value import Json

MAX_BYTES = 4_000_000
"""Bytes of the largest file that is read; chosen: far more than any autopilot stores."""


def _words(kind: str) -> re.Pattern[str]:
    """Return what finds the words of one kind in `fence_words.tsv`: lower case, one space apart."""
    words = "|".join(
        row["words"] for row in table("mission/fence_words.tsv") if row["kind"] == kind
    )
    return re.compile(rf"(?<!\bnot )(?<!\bnon )(?<!\bun )\b({words})\b")


_OUT, _IN, _FIELD = map(_words, ("out", "in", "field"))
"""Zones to stay out of; words of others, which contradict those; and what is one to stay in where
none of the first says more: "restricted field", "exclusion fence"."""

_TRUTH = dict.fromkeys(("true", "1", "yes"), True) | dict.fromkeys(("false", "0", "no"), False)
"""What words of a property say, in lower case."""

_WGS84 = re.compile(r"(?i)(.*[:/])?(CRS:?84|EPSG[:/]([\d.]*[:/])?4326)")

_HOW = (
    "name it as an inclusion or an exclusion, or give it a property inclusion: true (stay in) or "
    "false (stay out)"
)


class DrawnZone(NamedTuple):
    """A zone of a drawing: its polygons, each an outline and holes, and what is said of it.

    A corner is longitude, latitude and what else a drawing has, as numbers or texts. `place` is
    where the zone stands in the file; `around` are the names of what it is in.
    """

    place: str
    name: str
    properties: Mapping[str, object]
    around: Sequence[str]
    parts: Sequence[Sequence[Sequence[object]]]


def read_fence(path: Path) -> Fence:
    """Return the fence in the file `path`, whose format its name's ending tells.

    Raises `MissionFileError` if the ending is unknown or the file cannot be read, is too large,
    holds no fence, or leaves open what a polygon means.
    """
    match path.suffix.lower():
        case ".plan":
            fence = read_mission(path).fence
        case ".kml" | ".kmz":
            content = read_bytes(path, MAX_BYTES, "a fence", MissionFileError)
            fence = naming(path, lambda: kml_fence(content))
        case ".geojson" | ".json":
            text = read_text(path, MAX_BYTES, "a fence", MissionFileError)
            fence = naming(path, lambda: geojson_fence(text))
        case suffix:
            expected = "expected a .plan, .kml, .kmz or .geojson file"
            raise MissionFileError(f"{path}: {suffix or 'no ending'}; {expected}")
    if not fence:
        raise MissionFileError(f"{path}: holds no fence; expected polygons")
    return fence


def geojson_fence(text: str) -> Fence:
    """Return the fence that GeoJSON draws; a MultiPolygon is one zone, no polygon is none."""
    return fence_of(_of_geojson(Json.parsed(text), {}, ()))


def _of_geojson(
    value: Json, properties: Mapping[str, object], around: tuple[str, ...]
) -> Iterator[DrawnZone]:
    if value.get("crs") is not None:  # of GeoJSON before RFC 7946
        named = value["crs"]["properties"]["name"]
        named.checked(bool(_WGS84.fullmatch(str(named.value))), "WGS84, as EPSG:4326 or CRS84")
    match value["type"].value:
        case "FeatureCollection" | "GeometryCollection" as kind:
            name = value.members.get("name")
            around += (name,) if isinstance(name, str) else ()
            for each in value["features" if kind == "FeatureCollection" else "geometries"].each():
                yield from _of_geojson(each, properties, around)
        case "Feature":
            told, geometry = value.members.get("properties"), value.get("geometry")
            if geometry is not None:
                yield from _of_geojson(geometry, told if isinstance(told, dict) else {}, around)
        case "Polygon" | "MultiPolygon" as kind:
            coordinates = value["coordinates"].value
            parts = coordinates if kind == "MultiPolygon" else [coordinates]
            names = (told for key, told in properties.items() if key.casefold() == "name" and told)
            place, name = value.place or "the polygon", str(next(names, ""))
            yield DrawnZone(place, name, properties, around, parts)
        case "Point" | "MultiPoint" | "LineString" | "MultiLineString":
            pass
        case _:
            raise value["type"].wrong("a type of GeoJSON, as FeatureCollection")


def kml_fence(content: bytes) -> Fence:
    """Return the fence that a KML file draws, or a KMZ archive that holds one.

    The polygons of a placemark are one zone; its name, description and ExtendedData, and the names
    of the folders around it, say which kind.
    """
    if content.startswith(b"PK\x03\x04"):
        try:
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                names = [name for name in archive.namelist() if name.casefold().endswith(".kml")]
                content = archive.open(names[0]).read(MAX_BYTES + 1)
        except Exception as error:  # whatever the libraries of an archive's methods raise
            told = f"not a KMZ archive with a .kml file that can be read: {shortened(str(error))}"
            raise MissionFileError(told) from None
        if len(content) > MAX_BYTES:
            raise MissionFileError(f"the .kml file in it is larger than {MAX_BYTES:,} bytes")
    return fence_of(_of_kml(xml_tree(content), ()))


def _of_kml(element: Xml.Element, around: tuple[str, ...]) -> Iterator[DrawnZone]:
    name = _text(element, "name")
    if element.tag != "Placemark":
        for each in element:
            yield from _of_kml(each, (*around, name) if name else around)
        return
    place = f"polygon {quote(name)}" if name else "a polygon without a name"
    properties: dict[str, object] = {"description": _text(element, "description")}
    for data in (*element.iter("Data"), *element.iter("SimpleData")):
        properties[data.get("name", "")] = _text(data, "value") or (data.text or "").strip()
    parts = []
    for polygon in element.iter("Polygon"):
        outlines = polygon.findall("outerBoundaryIs/LinearRing")
        if len(outlines) > 1:
            raise MissionFileError(f"{place}: expected one outerBoundaryIs")
        rings = [*outlines, *polygon.findall("innerBoundaryIs/LinearRing")] if outlines else []
        texts = [_text(ring, "coordinates").split() for ring in rings]
        parts.append([[corner.split(",") for corner in corners] for corners in texts])
    if parts:
        yield DrawnZone(place, name, properties, around, parts)


def xml_tree(content: bytes) -> Xml.Element:
    """Return the elements of KML or GPX, without prefixes, which need not be declared.

    They have no document type: one is refused, for its entities may grow without end. Raises
    `MissionFileError`.
    """
    builder, parser = Xml.TreeBuilder(), expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise MissionFileError("a document type or entities; expected plain XML")

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


def _text(element: Xml.Element, tag: str) -> str:
    """Return the text of the first `tag` in `element`, without spaces around it."""
    return (element.findtext(tag) or "").strip()


def fence_of(zones: Iterable[DrawnZone]) -> Fence:
    """Return the fence of `zones`, whose notes name the polygons without corners, passed over.

    The parts of an inclusion are one area, which autopilots would intersect: they are joined. Its
    holes are exclusions; an exclusion with a hole, which no autopilot has, is refused.
    """
    polygons: list[Polygon] = []
    notes = []
    for zone in zones:
        try:
            parts = [[_ring(ring) for ring in part] for part in zone.parts]
            drawn = [part for part in parts if part and part[0]]
            polygons += _polygons(zone, drawn) if drawn else []
        except InputError as error:
            raise MissionFileError(f"{zone.place}: {error}") from None
        except TypeError:  # of what is no list
            raise MissionFileError(f"{zone.place}: expected lists of corners") from None
        if len(drawn) < len(parts):
            name = f" {quote(zone.name)}" if zone.name else ""
            notes.append(f"{zone.place}{name}: a polygon without corners, passed over")
    return Fence(tuple(polygons), notes=tuple(notes))


def _ring(told: Sequence[object]) -> list[LatLon]:
    """Return the corners of a ring, without the last one where that is the first again."""
    ring, told_as = [], "expected longitude, latitude in degrees"
    for each in told:
        try:
            longitude, latitude = map(float, each[:2] if isinstance(each, list) else ())
        except (TypeError, ValueError, OverflowError):
            raise MissionFileError(f"{quote(each)}; {told_as}") from None
        ring.append((latitude, longitude))
    return ring[:-1] if ring[:1] == ring[-1:] else ring


def _polygons(zone: DrawnZone, parts: list[list[list[LatLon]]]) -> Iterator[Polygon]:
    inclusion = _inclusion(zone)
    if inclusion and len(parts) > 1:
        parts = _joined(parts)
    elif not inclusion and any(len(part) > 1 for part in parts):
        raise MissionFileError("an exclusion with a hole, which no autopilot knows; cut it in two")
    for outline, *holes in parts:
        yield Polygon(tuple(outline), inclusion, zone.name)
        for hole in holes:
            yield Polygon(tuple(hole), False, f"hole of {zone.name}" if zone.name else "")


def _inclusion(zone: DrawnZone) -> bool:
    """Return whether the aircraft is to stay in the zone: as a property or else its words tell."""
    texts = [zone.name, *zone.around]
    for key, told in zone.properties.items():
        truth = _TRUTH.get(str(told).strip().casefold())
        if told is not None and key.casefold() in ("inclusion", "exclusion"):
            if truth is None:
                raise MissionFileError(f"property {key}: {quote(told)}; expected true or false")
            return truth is (key.casefold() == "inclusion")
        texts += [told] if isinstance(told, str) else []
        texts += [key] if truth else []
    parted = (re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).casefold() for text in texts)
    folded = " | ".join(" ".join(re.findall(r"[^\W_]+", text)) for text in parted)
    out, inside = _OUT.search(folded), _IN.search(folded)
    if out and inside:
        shown = ", ".join(quote(text) for text in texts if text)
        raise MissionFileError(
            f"{shown} tells both to stay in ({inside[1]}) and to stay out ({out[1]}); {_HOW}"
        )
    if not (out or inside or _FIELD.search(folded)):
        raise MissionFileError(
            f"{quote(zone.name)}: nothing tells whether to stay in it or out of it; {_HOW}"
        )
    return out is None


def _joined(parts: list[list[list[LatLon]]]) -> list[list[list[LatLon]]]:
    """Return the union of `parts`, each an outline and its holes, also across the date line."""
    check_outlines([Polygon(tuple(ring), True) for part in parts for ring in part])
    first = parts[0][0][0][1]
    shapes = []
    for part in parts:
        rings = [[(north, first + _turn(east - first)) for north, east in ring] for ring in part]
        shapes.append(shapely.Polygon(rings[0], rings[1:]))
        if not shapely.is_valid(shapes[-1]):
            raise MissionFileError("a part crosses or touches itself; put its corners in order")
    return [
        [[(n, _turn(e)) for n, e in ring.coords[:-1]] for ring in shapely.get_rings(each)]
        for each in shapely.get_parts(shapely.union_all(shapes))
    ]


def _turn(degrees: float) -> float:
    """Return an angle as one of -180 to 180 degrees."""
    return degrees if abs(degrees) <= 180 else (degrees + 180) % 360 - 180
