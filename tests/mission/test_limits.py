"""What no autopilot keeps is refused by every format, at the same count, in one line."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import SMALL

from faao_mav.errors import InputError
from faao_mav.mission import fence
from faao_mav.mission.fence import MAX_CORNERS, Circle, Fence, LatLon, Polygon, RallyPoint
from faao_mav.mission.fence_items import fence_items
from faao_mav.mission.formats import read_mission, write_mission
from faao_mav.mission.formats.fence_file import read_fence
from faao_mav.mission.formats.qgc_plan import read_qgc_plan
from faao_mav.mission.item import MAX_ITEMS, Mission, MissionItem
from faao_mav.plan import parse_plan, read_plan, yaml_text
from faao_mav.plan.yaml_text import MAX_CHARACTERS, dump_yaml

Zones = tuple[tuple[LatLon, ...], ...]
"""Corners of exclusions in degrees."""


def ring(corners: int, number: int = 0) -> tuple[LatLon, ...]:
    """Return the corners of a thin strip that crosses nothing."""
    half, west = corners // 2, 149.17 + number * 1e-5
    there = [(-35.36 + k * 1e-6, west) for k in range(half)]
    back = [(-35.36 + k * 1e-6, west + 5e-6) for k in reversed(range(corners - half))]
    return (*there, *back)


def as_plan(zones: Zones, folder: Path) -> Path:
    path = folder / "x.plan"
    polygons = [{"polygon": zone, "inclusion": False, "version": 1} for zone in zones]
    contents = {
        "fileType": "Plan",
        "version": 1,
        "mission": {"version": 2, "items": []},
        "geoFence": {"version": 2, "polygons": polygons, "circles": []},
    }
    path.write_text(json.dumps(contents))
    return path


def as_geojson(zones: Zones, folder: Path) -> Path:
    path = folder / "x.geojson"
    rings = [[[list(place[::-1]) for place in zone]] for zone in zones]
    features = [
        {
            "type": "Feature",
            "properties": {"name": f"no-fly {k}"},
            "geometry": {"type": "Polygon", "coordinates": ring},
        }
        for k, ring in enumerate(rings)
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def as_kml(zones: Zones, folder: Path) -> Path:
    path = folder / "x.kml"
    placemarks = "".join(
        f"<Placemark><name>no-fly {k}</name><Polygon><outerBoundaryIs><LinearRing><coordinates>"
        + " ".join(f"{longitude},{latitude}" for latitude, longitude in zone)
        + "</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>"
        for k, zone in enumerate(zones)
    )
    path.write_text(f"<kml><Document>{placemarks}</Document></kml>")
    return path


def as_rows(zones: Zones, folder: Path) -> Path:
    path = folder / "x.waypoints"
    write_mission(Mission((MissionItem(16, 3),)), path)
    rows = [
        f"{k}\t0\t0\t{item.command}\t{item.params[0]}\t0\t0\t0\t{item.x}\t{item.y}\t0\t1"
        for zone in zones
        for k, item in enumerate(fence_items(Fence((Polygon(zone, False),))))
    ]
    (folder / "x.fence.waypoints").write_text("\n".join(["QGC WPL 110", *rows]))
    return path


def as_yaml(zones: Zones, folder: Path) -> Path:
    path = folder / "x.yaml"
    places = [{"polygon": [{"latitude": a, "longitude": b} for a, b in zone]} for zone in zones]
    path.write_text(f"{SMALL}fence: {{exclusion: {json.dumps(places)}}}\n")
    return path


FORMATS: dict[Callable[[Zones, Path], Path], Callable[[Path], object]] = {
    as_plan: read_mission,
    as_geojson: read_fence,
    as_kml: read_fence,
    as_rows: read_mission,
    as_yaml: read_plan,
}


def comb(teeth: int, *, across: bool) -> tuple[LatLon, ...]:
    """Return the corners of a comb of 200 m; its teeth cross each of one `across` four times."""
    corners = [(-35.361, 149.17)]
    for k in range(teeth):
        near, far = -35.361 + 0.002 * k / teeth, -35.361 + 0.002 * (k + 0.5) / teeth
        corners += [(near, 149.171), (near, 149.173), (far, 149.173), (far, 149.171)]
    corners.append((-35.359, 149.17))
    return tuple((b - 184.532, a + 184.532) for a, b in corners) if across else tuple(corners)


@pytest.mark.parametrize("write", FORMATS)
def test_a_fence_has_the_same_limits_in_all_formats(
    write: Callable[[Zones, Path], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fence, "MAX_CORNERS", 1_000)  # as many as are quick to read
    read = FORMATS[write]
    many = tuple(ring(3, k) for k in range(255))
    long = (ring(600), ring(400, 1))
    for kept in (many, long):
        read(write(kept, tmp_path))
    for zones, told in (
        ((*many, ring(3, 255)), "256 exclusion polygons; at most 255 are accepted"),
        ((*long, ring(3, 2)), "1,003 corners and circles; at most 1,000 are accepted"),
        ((comb(112, across=False), comb(120, across=True)), "its outlines cross at more than 50,0"),
    ):
        path = write(zones, tmp_path)
        with pytest.raises(InputError, match=rf"x\.(fence\.)?[a-z]+: fence: {told}") as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_all_outlines_count_by_kind_and_where_they_cross(tmp_path: Path) -> None:
    for inclusion in (True, False):
        circles = (Circle((1.0, 2.0), 3.0, inclusion),) * 255
        assert Fence((), circles)
        with pytest.raises(InputError, match=r"256 (in|ex)clusion circles"):
            Fence((), (*circles, circles[0]))
    star = [(math.cos(2.4 * k) / 1e3, math.sin(2.4 * k) / 1e3) for k in range(100)]
    teeth = Polygon(comb(1_000, across=False), False)
    rings = tuple(Circle((-35.36, 149.172), 50.0 + k / 10, False) for k in range(100))
    assert Fence((Polygon(tuple(star), False),) * 3)
    assert Fence((teeth,), rings[:5])
    for polygons, around in (((Polygon(tuple(star), False),) * 81, ()), ((teeth,), rings)):
        with pytest.raises(InputError, match="cross at more than 50,000 places"):
            Fence(polygons, around)
    parts = [
        [[list(place[::-1]) for place in comb(249, across=across)]] for across in (True, False)
    ]
    geometry = {"type": "MultiPolygon", "coordinates": parts}
    feature = {"type": "Feature", "properties": {"name": "field"}, "geometry": geometry}
    (tmp_path / "x.geojson").write_text(json.dumps(feature))
    with pytest.raises(InputError, match=r"x\.geojson: geometry: fence: its outlines cross at"):
        read_fence(tmp_path / "x.geojson")


def test_the_fence_of_a_plan_and_that_of_its_file_have_the_limit_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fence, "MAX_CORNERS", 1_000)
    as_geojson((ring(600),), tmp_path)
    path = as_yaml((ring(400, 1),), tmp_path)
    path.write_text(path.read_text().replace("fence: {", "fence: {file: x.geojson, "))
    text = read_plan(path).text  # the copy beside a result, with all corners in it
    assert sum(len(polygon.vertices) for polygon in parse_plan(text).geofence.polygons) == 1_000
    as_geojson((ring(601),), tmp_path)
    with pytest.raises(InputError, match=r"x\.yaml: fence: 1,001 corners and circles"):
        read_plan(path)


def test_the_largest_fence_fits_into_the_longest_plan() -> None:
    place = {"latitude": -35.000000000000004, "longitude": -149.00000000000003}
    one, other = (
        dump_yaml({"fence": {"exclusion": [{"polygon": [place] * count}]}}) for count in (1, 2)
    )
    corner = len(other) - len(one)
    assert corner * MAX_CORNERS + len(SMALL) < MAX_CHARACTERS


def test_more_items_than_a_count_can_tell_are_refused(tmp_path: Path) -> None:
    row = "\n0 0 3 16 0 0 0 0 1 1 1 1"
    path = tmp_path / "x.waypoints"
    path.write_text("QGC WPL 110" + row * (MAX_ITEMS + 1))
    assert len(read_mission(path).items) == MAX_ITEMS
    path.write_text("QGC WPL 110" + row * (MAX_ITEMS + 2))
    with pytest.raises(InputError, match="65,536 items; at most 65,535 are accepted"):
        read_mission(path)
    with pytest.raises(InputError, match="256 rally points; at most 255"):
        Mission((), rally=(RallyPoint(1.0, 2.0, 3.0),) * 256)


def test_endless_lists_of_a_plan_file_are_not_read_to_their_end(tmp_path: Path) -> None:
    text = as_plan((), tmp_path).read_text()
    text = text[:-1] + ', "rallyPoints": {"version": 2, "points": []}}'
    item = '{"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, 0, 1, 1, 1]}'
    for key, one, most in (
        ("mission.items", item, MAX_ITEMS),
        ("geoFence.polygons", '{"version": 1, "polygon": [], "inclusion": true}', MAX_CORNERS),
        ("rallyPoints.points", "[1, 1, 1]", MAX_CORNERS),
    ):
        inside = f'"{key.rpartition(".")[2]}": ['
        with pytest.raises(InputError, match=rf"{key}: more than {most:,} values"):
            read_qgc_plan(text.replace(inside, inside + ", ".join([one] * (most + 1))))


def test_a_plan_of_too_many_values_is_not_read_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_text, "_MAX_VALUES", 1_000)
    for value in ("[]", "{}", "1", "{a: 1}", "a: 1", "''"):
        with pytest.raises(InputError, match=r"line 1, .* 1,000 keys and values"):
            parse_plan("{a: [" + f"{value}," * 1_000 + "]}")
