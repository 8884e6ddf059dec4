"""Where a fence lets the aircraft be: areas, ways and convex pieces, against brute force."""

import hypothesis.strategies as st
import numpy as np
import pytest
import shapely
from hypothesis import given

from faao_mav.mission.fence_area import FreeArea
from faao_mav.mission.polygons import convex_pieces

coordinates = st.floats(0, 100, allow_subnormal=False)
places = st.tuples(coordinates, coordinates)
rings = st.lists(places, min_size=3, max_size=8, unique=True).map(shapely.Polygon)
polygons = rings.filter(lambda ring: ring.is_valid and ring.area > 10)


@given(polygon=polygons)
def test_pieces_are_convex_and_make_up_the_polygon(polygon: shapely.Polygon) -> None:
    pieces = [shapely.Polygon(piece) for piece in convex_pieces(polygon)]
    assert sum(piece.area for piece in pieces) == pytest.approx(polygon.area, rel=1e-6)
    assert shapely.union_all(pieces).symmetric_difference(polygon).area < 1e-6 * polygon.area
    for piece in pieces:
        assert piece.convex_hull.area == pytest.approx(piece.area, rel=1e-9)
        assert piece.exterior.is_ccw
    corners = shapely.get_coordinates(shapely.orient_polygons(polygon))[:-1]
    before, after = (np.roll(corners, k, axis=0) - corners for k in (1, -1))
    inward = int(np.sum(after[:, 0] * before[:, 1] < after[:, 1] * before[:, 0]))
    assert len(pieces) <= 2 * inward + 1  # Hertel and Mehlhorn's bound


@given(zones=st.lists(polygons, min_size=1, max_size=3))
def test_the_shortest_way_is_the_shortest_of_all_that_turn_at_corners(
    zones: list[shapely.Polygon],
) -> None:
    area = shapely.box(-50, -50, 150, 150) - shapely.union_all(zones)
    start, end = np.array([-40.0, -40.0]), np.array([140.0, 130.0])
    way = FreeArea(area).shortest_way(start, end)
    nodes = np.vstack([start, end, np.unique(shapely.get_coordinates(area), axis=0)])
    first, second = np.triu_indices(len(nodes), 1)
    lines = np.asarray(shapely.linestrings(np.stack([nodes[first], nodes[second]], axis=1)))
    seen = shapely.covers(area, lines)
    length = np.full((len(nodes), len(nodes)), np.inf)
    apart = shapely.length(lines[seen])
    length[first[seen], second[seen]] = length[second[seen], first[seen]] = apart
    for node in range(len(nodes)):
        length = np.minimum(length, length[:, node, None] + length[node])
    assert way is not None
    assert shapely.covers(area.buffer(1e-9), shapely.LineString(way))
    assert shapely.LineString(way).length == pytest.approx(length[0, 1], rel=5e-3)
    assert shapely.LineString(way).length >= length[0, 1] * (1 - 1e-9)


def test_the_way_about_circles_keeps_off_their_arcs_and_finds_the_narrow_gaps() -> None:
    start, end = np.array([-90.0, 0.0]), np.array([90.0, 0.0])
    for gap, walled, length in ((1.0, False, 180.0), (0.02, True, 180.0), (0.02, False, 180.0)):
        discs = [shapely.Point(0, y).buffer(50 - gap / 2, quad_segs=64) for y in (-50, 50)]
        ends = 60 if walled else 500
        area = FreeArea(shapely.box(-100, -ends, 100, ends) - shapely.union_all(discs))
        way = area.shortest_way(start, end)
        assert way is not None
        assert shapely.LineString(way).length == pytest.approx(length, rel=0.01)


def test_no_way_between_two_parts() -> None:
    parts = shapely.box(0, 0, 10, 10) | shapely.box(20, 0, 30, 10)
    assert FreeArea(parts).shortest_way(np.array([5.0, 5.0]), np.array([25.0, 5.0])) is None
    assert FreeArea(parts).nearest(np.array([18.0, 5.0]), np.array([5.0, 5.0])).tolist() == [10, 5]


def test_clearance_has_the_sign_of_being_inside() -> None:
    area = FreeArea(shapely.box(0, 0, 100, 100) - shapely.box(40, 40, 60, 60))
    assert area.clearance(np.array([[10.0, 50.0], [30.0, 50.0]])) == 10
    assert area.clearance(np.array([[10.0, 50.0], [45.0, 50.0]])) == pytest.approx(-5, abs=0.5)
    assert area.clearance(np.array([[110.0, 50.0]])) == -10
    assert area.inside(5).covers(np.array([[36.0, 50.0], [34.0, 50.0]])).tolist() == [False, True]
