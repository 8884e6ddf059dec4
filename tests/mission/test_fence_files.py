"""Fences from KML, KMZ and GeoJSON: whether a zone is one to stay in or out of above all."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import pytest

from faao_mav.errors import MissionFileError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import areas_of, free_area
from faao_mav.mission.formats.fence_file import geojson_fence, kml_fence, read_fence

DATA = Path(__file__).parent.parent / "data"
SQUARE = [[8.0, 47.0], [8.1, 47.0], [8.1, 47.1], [8.0, 47.0]]
HOLE = [[8.05, 47.01], [8.06, 47.01], [8.06, 47.02], [8.05, 47.01]]
KML = (DATA / "fences" / "holes.kml").read_text()


def geojson(value: Any) -> Fence:
    return geojson_fence(json.dumps(value))


def feature(kind: str, coordinates: Any, properties: object) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def collection(*features: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features)} | more


WORDS = [
    line.split(" | ")
    for line in (DATA / "fences" / "words.txt").read_text().splitlines()
    if not line.startswith("#")
]


def inclusion(properties: object, **layer: str) -> bool:
    (polygon,) = geojson(collection(feature("Polygon", [SQUARE], properties), **layer)).polygons
    return polygon.inclusion


def test_words_tell_zones_to_stay_in_and_out_of_no_case_or_layer_lets_into_one() -> None:
    for kind, text in WORDS:
        said = json.loads(text)
        if kind == "asked":
            with pytest.raises(MissionFileError, match=r"geometry: .*property inclusion: true"):
                inclusion(said)
            continue
        assert inclusion(said) is (kind == "in"), text
        upper = {
            key.upper(): value.upper() if isinstance(value, str) and " " in value else value
            for key, value in said.items()
        }
        for told in (
            (said, upper, {key.lower(): said[key] for key in said}) if kind == "out" else ()
        ):
            assert inclusion(told) is inclusion(told, name="my field") is False
    assert inclusion({"name": "school"}, name="no-fly zones") is False
    with pytest.raises(MissionFileError, match=r"tells both to stay in .keep in. and to stay out"):
        inclusion({"name": "keep-in field"}, name="no-fly zones")


def test_polygons_of_kml_with_holes_and_exclusions() -> None:
    field, hole, school, kind = kml_fence(KML.encode()).polygons
    assert field.vertices == ((47.0, 8.0), (47.0, 8.1), (47.1, 8.1))
    assert [each.inclusion for each in (field, hole, school, kind)] == [True, False, False, False]
    assert hole.vertices[0] == (47.01, 8.05)
    assert [each.name for each in (field, hole, school)] == ["field", "hole of field", "school"]
    for encoding in ("utf-8-sig", "utf-16", "iso-8859-1", "windows-1252"):
        text = KML.replace("UTF-8", encoding.removesuffix("-sig")).replace("school", "école")
        assert kml_fence(text.encode(encoding)).polygons[2].name == "école"


def test_the_parts_of_an_inclusion_are_one_area() -> None:
    west = [[179.9975, -17.002], [180.0, -17.002], [180.0, -16.997], [179.9975, -16.997]]
    east = [[-180.0, -17.002], [-179.9975, -17.002], [-179.9975, -16.997], [-180.0, -16.997]]
    (joined,) = geojson(feature("MultiPolygon", [[west], [east]], {"name": "field"})).polygons
    areas = areas_of(Fence((joined,)), LocalFrame(-17.0, 180.0))
    area = free_area(areas, any_inclusion=False)
    assert area is not None
    west_edge, _, east_edge, _ = area.bounds
    assert (west_edge, east_edge) == pytest.approx((-266.2, 266.2), abs=0.5)
    over_hole = [[SQUARE, HOLE], [HOLE]]
    assert len(geojson(feature("MultiPolygon", over_hole, {"name": "field"})).polygons) == 1
    apart = [[SQUARE], [[[9.0, 47.0], [9.1, 47.0], [9.1, 47.1]]]]
    assert len(geojson(feature("MultiPolygon", apart, {"name": "no-fly"})).polygons) == 2


def test_an_empty_part_is_named_and_passed_over() -> None:
    inner = {"type": "Polygon", "coordinates": [SQUARE]}
    found = geojson(collection(
        feature("", [], {"name": "field"})
        | {"geometry": {"type": "GeometryCollection", "geometries": [inner]}},
        feature("MultiPolygon", [[]], {}),
        feature("MultiPolygon", [[HOLE], []], {"name": "no-fly"}),
        feature("Polygon", [], {"name": "school"}),
        feature("Point", [8, 47], None),
    ))  # fmt: skip
    assert [polygon.inclusion for polygon in found.polygons] == [True, False]
    assert [note.partition(":")[0] for note in found.notes] == [
        "features[1].geometry",
        "features[2].geometry 'no-fly'",
        "features[3].geometry 'school'",
    ]


def test_what_is_no_fence_is_refused_with_its_place(tmp_path: Path) -> None:
    crossing = [[[[0, 0], [1, 1], [1, 0], [0, 1]]], [SQUARE]]
    nfz = "<ExtendedData><Data name='a'><value>NFZ</value></Data></ExtendedData><gx"
    entity = '<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE a [<!ENTITY b "c">]><kml>&b;</kml>'
    for content, told in (
        ({"type": "Feature", "geometry": {"type": "Curve"}}, "geometry.type: 'Curve'"),
        ({"type": "Polygon", "coordinates": 5}, "the polygon: expected lists of corners"),
        (feature("Polygon", [[[47.0, 500.0], *SQUARE]], {"name": "NFZ"}), "fence polygon: 500.0"),
        (feature("Polygon", [[[47.0, "x"], *SQUARE]], {}), r"geometry: .47.0, 'x'.; expected lo"),
        (feature("Polygon", [[[1, 2], [3, 4]]], {"name": "field"}), "2 vertices; expected at"),
        ({"type": "Polygon", "coordinates": [["12"]]}, "'12'; expected longitude, latitude in"),
        (feature("Polygon", [SQUARE], {"inclusion": "perhaps"}), "expected true or false"),
        (feature("Polygon", [SQUARE, HOLE], {"inclusion": False}), "an exclusion with a hole"),
        (feature("MultiPolygon", crossing, {"name": "field"}), "a part crosses or touches itself"),
        (collection(), "holds no fence"),
        (
            collection(crs={"properties": {"name": "EPSG:32633"}}),
            "crs.properties.name: .*32633'; expe",
        ),
        ("<kml>", "not XML"),
        (KML.replace("innerB", "outerB"), "polygon 'field': expected one outerBoundaryIs"),
        (KML.replace("<gx", nfz), "an exclusion with a hole"),
        (KML.replace("8.1,47,0", "8.1;47"), r"polygon 'field': .'8.1;47'.; expected longi"),
        (KML.replace("8.1,47,0", "800,47,0"), "polygon 'field': fence polygon: 47.0, 800.0"),
        (KML.replace("8.1,47,0", "nan,47,0"), "polygon 'field'"),
        ("<kml>" + "<a><name>b</name>" * 6000 + "</a>" * 6000 + "</kml>", "nested too deep"),
        (entity.encode("utf-16"), "document type or entities"),
    ):
        path = tmp_path / ("a.geojson" if isinstance(content, dict) else "a.kml")
        text = json.dumps(content) if isinstance(content, dict) else content
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        with pytest.raises(MissionFileError, match=rf"{path.name}: .*{told}"):
            read_fence(path)
    for name, told in (("d.shp", r"\.shp"), ("e.kml", "read")):
        with pytest.raises(MissionFileError, match=f"{name}: .*{told}"):
            read_fence(tmp_path / name)
    new = feature("Polygon", [SQUARE], {"name": "NFZ"}) | {"crs": {"properties": {"name": "CRS84"}}}
    (tmp_path / "b.GeoJSON").write_text(json.dumps(new))
    assert len(read_fence(tmp_path / "b.GeoJSON").polygons) == 1
    assert len(read_fence(DATA / "missions" / "fence_and_rally.plan").circles) == 1


def test_kmz_is_the_kml_in_an_archive() -> None:
    def kmz(name: str, text: str) -> bytes:
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("files/picture.png", b"")
            file.writestr(name, text)
        return archive.getvalue()

    assert kml_fence(kmz("doc.KML", KML)) == kml_fence(KML.encode())
    for content, told in (
        (kmz("doc.kml", KML)[:60], "not a KMZ archive"),
        (b"PK\3\4", "not a KMZ archive"),
        (kmz("doc.txt", KML), r"with a \.kml file"),
        (kmz("doc.kml", " " * 10_000_000), "larger than 4,000,000 bytes"),
    ):
        with pytest.raises(MissionFileError, match=told):
            kml_fence(content)
