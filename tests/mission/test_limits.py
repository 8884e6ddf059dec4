"""What is impossible, or no autopilot keeps, is refused by every format alike, in one line."""

import cmath
import json
import math
from pathlib import Path

import pytest
from conftest import SMALL
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from faao_mav.errors import InputError
from faao_mav.mission import Command, Frame, Home, Mission, MissionItem, fence, item
from faao_mav.mission.fence import MAX_CORNERS, Circle, Fence, LatLon, Polygon, RallyPoint
from faao_mav.mission.formats import qgc_plan, wpl, write_qgc_plan
from faao_mav.mission.formats.fence_file import read_fence
from faao_mav.mission.item import MAX_ITEMS
from faao_mav.plan import parse_plan, read_plan, yaml_text


def ring(corners: int, turned: float = 0.0) -> tuple[LatLon, ...]:
    """Return the corners of a star, turned by so many: its outline does not cross itself."""
    turns = [2 * math.pi * (k + turned) / corners for k in range(corners)]
    sizes = [1e-3 * (1 + k % 2) for k in range(corners)]
    ways = zip(sizes, turns, strict=True)
    return tuple((-35.36 + r * math.cos(t), 149.17 + r * math.sin(t)) for r, t in ways)


def as_geojson(path: Path, *zones: tuple[LatLon, ...], kind: str = "no-fly") -> None:
    parts = [[[place[::-1] for place in zone]] for zone in zones]
    geometry = {"type": "MultiPolygon", "coordinates": parts}
    path.write_text(
        json.dumps({"type": "Feature", "properties": {"name": kind}, "geometry": geometry})
    )


def test_commands_and_frames_have_mavlinks_numbers() -> None:
    for kind, prefix in ((Command, "MAV_CMD"), (Frame, "MAV_FRAME")):
        for each in kind:
            assert mavlink.enums[prefix][int(each)].name == f"{prefix}_{each.name}"


def test_what_is_impossible_is_refused() -> None:
    for kind, arguments, told in (
        (MissionItem, (65_536, 3), "command 65536; expected 0 to 65535"),
        (MissionItem, (16, -1), "frame -1; expected 0 to 255"),
        (MissionItem, (16, 3, (0.0, 0.0, math.nan, math.inf)), "expected finite"),
        (MissionItem, (16, 3, (0.0,) * 4, 0.0, 0.0, -math.inf), "expected finite"),
        (Home, (91.0, 0.0, 0.0), "home"),
        (Home, (0.0, 180.1, 0.0), "home"),
        (Home, (0.0, 0.0, math.inf), "home"),
    ):
        with pytest.raises(InputError, match=told):
            kind(*arguments)


def test_all_outlines_count_by_kind_and_where_they_cross(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert (fence.MAX_CORNERS, fence.MAX_CROSSINGS) == (8_192, 50_000)
    monkeypatch.setattr(fence, "MAX_CORNERS", 100)
    few = Polygon(ring(40), False)
    assert Fence((few, Polygon(ring(60), False)))
    with pytest.raises(InputError, match="101 corners and circles; at most 100 are accepted"):
        Fence((few, Polygon(ring(61), False)))
    path, drawn = tmp_path / "x.yaml", tmp_path / "x.geojson"
    as_geojson(drawn, ring(60))  # a plan's own fence and that of its file have it together
    places = [{"latitude": north, "longitude": east} for north, east in ring(40)]
    zones = json.dumps([{"polygon": places}])
    path.write_text(f"{SMALL}fence: {{file: x.geojson, exclusion: {zones}}}\n")
    text = read_plan(path).text  # the copy beside a result, with all corners in it
    assert sum(len(polygon.vertices) for polygon in parse_plan(text).geofence.polygons) == 100
    as_geojson(drawn, ring(61))
    with pytest.raises(InputError, match=r"x\.yaml: fence: 101 corners and circles"):
        read_plan(path)

    monkeypatch.setattr(fence, "MAX_CORNERS", 256)
    for inclusion in (True, False):
        circles = (Circle((1.0, 2.0), 3.0, inclusion),) * 255
        assert Fence((), circles)
        with pytest.raises(InputError, match=r"256 (in|ex)clusion circles"):
            Fence((), (*circles, circles[0]))
    knot = [1e-3 * cmath.exp(2.4j * k) for k in range(14)]
    knots = (Polygon(tuple((each.real, each.imag) for each in knot), False),) * 2
    stars = tuple(Polygon(ring(60, turned), False) for turned in (0.0, 0.5))
    row = tuple(Circle((-35.36, 149.17 + k * 1e-4), 150.0, False) for k in range(8))
    for polygons, around, crossings in (
        (knots, (), 208),
        (stars, (), 60),
        (stars[:1], row[:1], 60),
        ((), row, 56),
    ):
        monkeypatch.setattr(fence, "MAX_CROSSINGS", crossings)
        assert Fence(polygons, around)
        monkeypatch.setattr(fence, "MAX_CROSSINGS", crossings - 1)
        with pytest.raises(InputError, match=f"cross at more than {crossings - 1} places"):
            Fence(polygons, around)
    as_geojson(drawn, *(each.vertices for each in stars), kind="field")
    with pytest.raises(InputError, match=r"x\.geojson: geometry: fence: its outlines cross at"):
        read_fence(drawn)


def test_endless_lists_are_not_read_to_their_end(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (MAX_ITEMS, yaml_text._MAX_VALUES) == (65_535, 6 * MAX_CORNERS)
    for module in (item, qgc_plan, wpl):
        monkeypatch.setattr(module, "MAX_ITEMS", 50)
    monkeypatch.setattr(qgc_plan, "MAX_CORNERS", 50)
    row = "\n0 0 3 16 0 0 0 0 1 1 1 1"
    text = "QGC WPL 110" + row * 51
    assert len(wpl.read_wpl(text).mission.items) == 50
    with pytest.raises(InputError, match="51 items; at most 50 are accepted"):
        wpl.read_wpl(text + row)
    with pytest.raises(InputError, match="256 rally points; at most 255"):
        Mission((), rally=(RallyPoint(1.0, 2.0, 3.0),) * 256)
    text = write_qgc_plan(Mission(()))
    flown = '{"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, 0, 1, 1, 1]}'
    for key, one in (
        ("mission.items", flown),
        ("geoFence.polygons", '{"version": 1, "polygon": [], "inclusion": true}'),
        ("rallyPoints.points", "[1, 1, 1]"),
    ):
        inside = f'"{key.rpartition(".")[2]}": ['
        with pytest.raises(InputError, match=rf"{key}: more than 50 values"):
            qgc_plan.read_qgc_plan(text.replace(inside, inside + ", ".join([one] * 51)))
    monkeypatch.setattr(yaml_text, "_MAX_VALUES", 100)
    for value in ("[]", "{}", "1", "{a: 1}", "a: 1", "''"):
        with pytest.raises(InputError, match=r"line 1, .* 100 keys and values"):
            parse_plan("{a: [" + f"{value}," * 100 + "]}")
