"""Fences from KML and GeoJSON."""

import json
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import given

from faao_mav.errors import MissionFileError
from faao_mav.mission.fence import Fence
from faao_mav.mission.formats.fence_file import read_fence
from faao_mav.mission.formats.geojson import read_geojson_fence
from faao_mav.mission.formats.kml_fence import read_kml_fence

SQUARE = [[8.0, 47.0], [8.1, 47.0], [8.1, 47.1], [8.0, 47.0]]
HOLE = [[8.05, 47.01], [8.06, 47.01], [8.06, 47.02], [8.05, 47.01]]

KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Placemark><name>field</name><Polygon>
<outerBoundaryIs><LinearRing><coordinates>8,47,0 8.1,47,0 8.1,47.1,0 8,47,0</coordinates></LinearRing>
</outerBoundaryIs><innerBoundaryIs><LinearRing><coordinates>
8.05,47.01 8.06,47.01 8.06,47.02 8.05,47.01</coordinates></LinearRing></innerBoundaryIs></Polygon>
</Placemark><Folder><name>No-fly zones</name><Placemark><name>school</name><MultiGeometry><Polygon>
<outerBoundaryIs><LinearRing><coordinates>8,47 8.1,47 8.1,47.1</coordinates></LinearRing>
</outerBoundaryIs></Polygon></MultiGeometry></Placemark></Folder>
<Placemark><name>mast</name><Point><coordinates>8,47</coordinates></Point></Placemark>
</Document></kml>"""  # noqa: E501


def geojson(value: Any) -> Fence:
    return read_geojson_fence(json.dumps(value), "x.geojson")


def feature(kind: str, coordinates: Any, properties: Any) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def test_polygons_of_kml_with_holes_and_exclusions() -> None:
    field, hole, school = read_kml_fence(KML, "x.kml").polygons
    assert field.vertices == ((47.0, 8.0), (47.0, 8.1), (47.1, 8.1))
    assert (field.inclusion, hole.inclusion, school.inclusion) == (True, False, False)
    assert hole.vertices[0] == (47.01, 8.05)


def test_polygons_of_geojson_with_holes_and_exclusions() -> None:
    found = geojson({
        "type": "FeatureCollection",
        "features": [
            feature("Polygon", [SQUARE, HOLE], {"name": "field"}),
            feature("MultiPolygon", [[HOLE], [SQUARE]], {"inclusion": False}),
            feature("Polygon", [HOLE], {"name": "keep out"}),
            feature("Point", [8, 47], None),
        ],
    })  # fmt: skip
    assert [polygon.inclusion for polygon in found.polygons] == [True, False, False, False, False]
    assert found.polygons[0].vertices == ((47.0, 8.0), (47.0, 8.1), (47.1, 8.1))


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ({"type": "Feature", "geometry": {"type": "Curve"}}, "geometry.type: 'Curve'"),
        ({"type": "Polygon", "coordinates": 5}, "coordinates: 5; expected a list"),
        ({"type": "Polygon", "coordinates": [[[47.0, 500.0]]]}, r"\[0\]\[0\]"),
        ({"type": "Polygon", "coordinates": [[[1, 2], [3, 4]]]}, "2 vertices; expected at least 3"),
        ({"type": "Polygon", "coordinates": [["a"]]}, "expected .longitude, latitude."),
        (feature("Polygon", [SQUARE], {"inclusion": "no"}), "expected true or false"),
        (feature("Polygon", [SQUARE, HOLE], {"inclusion": False}), "an exclusion with a hole"),
    ],
)
def test_what_is_no_fence_is_refused_with_its_place(value: Any, told: str) -> None:
    with pytest.raises(MissionFileError, match=f"x.geojson: .*{told}"):
        geojson(value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("<kml>", "not XML"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><kml>&b;</kml>", "document type or entities"),
        (KML.replace("8.1,47,0", "8.1;47"), "polygon 'field': '8.1;47'"),
        (KML.replace("8.1,47,0", "800,47,0"), "polygon 'field': fence polygon: 47.0, 800.0"),
        (KML.replace("8.1,47,0", "nan,47,0"), "polygon 'field'"),
        ("<kml>" + "<Folder>" * 60 + "</Folder>" * 60 + "</kml>", "nested more than 50 deep"),
    ],
)
def test_broken_kml_is_refused(text: str, told: str) -> None:
    with pytest.raises(MissionFileError, match=f"x.kml: .*{told}"):
        read_kml_fence(text, "x.kml")


@given(value=st.recursive(
    st.none() | st.booleans() | st.floats(-200, 200) | st.sampled_from(["Polygon", "Feature"]),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(
        st.sampled_from(["type", "coordinates", "geometry", "features", "properties"]), inner
    ),
    max_leaves=20,
))  # fmt: skip
def test_any_json_is_a_fence_or_an_error(value: Any) -> None:
    try:
        geojson(value)
    except MissionFileError as error:
        assert str(error).startswith("x.geojson: ")


def test_files_by_their_ending(tmp_path: Path) -> None:
    (tmp_path / "a.kml").write_text(KML)
    (tmp_path / "b.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [SQUARE]}))
    (tmp_path / "c.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    assert len(read_fence(tmp_path / "a.kml").polygons) == 3
    assert len(read_fence(tmp_path / "b.geojson").polygons) == 1
    assert len(read_fence(Path("tests/data/missions/fence_and_rally.plan")).circles) == 1
    for name, told in (("c.geojson", "holds no fence"), ("d.shp", "'.shp'"), ("e.kml", "read")):
        with pytest.raises(MissionFileError, match=told):
            read_fence(tmp_path / name)
