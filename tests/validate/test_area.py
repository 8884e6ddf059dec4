"""Fences in the plane, against plain distances."""

import math
from dataclasses import replace
from itertools import pairwise

import hypothesis.strategies as st
import numpy as np
import pytest
import shapely
from hypothesis import given as drawn
from judged import FRAME, given, polygon
from shapely.geometry.base import BaseGeometry

from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import areas_of, free_area

metres = st.integers(-5000, 5000).map(lambda tenths: tenths / 10)
places = st.tuples(metres, metres)
Place = tuple[float, float]


def between(a: Place, b: Place, fence: str) -> bool:
    """Whether the leg from a to b leaves the fence."""
    case = given(f"{fence} waypoint:{a[0]!r},{a[1]!r},30 waypoint:{b[0]!r},{b[1]!r},30")
    return 2 in {finding.item for finding in case.by("fence-leg")}


@drawn(a=places, b=places, center=places, radius=st.floats(1, 300))
def test_a_leg_is_outside_as_plain_distances_tell(
    a: Place, b: Place, center: Place, radius: float
) -> None:
    nearest = float(shapely.distance(shapely.Point(center), shapely.LineString([a, b]))) - radius
    farthest = radius - max(math.dist(center, a), math.dist(center, b))
    for zone, spare in (("zone", nearest), ("disc", farthest)):
        if abs(spare) > 1e-3 * radius:
            assert between(a, b, f"{zone}:{center[0]!r},{center[1]!r},{radius!r}") == (spare < 0)


def margin(line: str) -> tuple[float, int | None]:
    """The margin that is told of a mission, and its item."""
    (told,) = given(line).by("fence-margin")
    return float(told.message.split(" m ")[0]), told.item


def test_the_margin_is_the_distance_to_the_nearest_edge() -> None:
    for spare in (3.0, 25.0, 40.0):
        inside = margin(f"square:200 takeoff waypoint:0,{100 - spare},30 return")
        around = margin(f"zone:{50 + spare},50,50 takeoff waypoint:0,100,30 return")
        assert inside[0] == pytest.approx(spare, abs=0.06)
        assert around[0] == pytest.approx(spare, abs=0.06)
    posts = " ".join(f"zone:{40 + 20 * k},{30 * (k % 9)},5" for k in range(255))
    assert margin(f"square:20000 {posts} takeoff row=9,25 return")[0] == 35.0
    nested = " ".join(f"zone:0,60,{10 + k}" for k in range(100))
    out = given(f"{nested} takeoff waypoint:0,300,30 return").by("fence-leg")[0]
    assert out.message.count("m of it inside exclusion circle") == 3  # of many three are named
    way = "takeoff waypoint:0,100,30 return"
    bulge = "fly:5;0,0,0;60,50,30,0;0,100,30,1"
    assert margin(f"square:300 {bulge} {way}")[0] == 50.0
    assert margin(f"square:300 fly:5;0,0,0;120,50,30,1 {way}") == (30.0, 2)
    (out,) = given("px4 square:100 square:100,180 takeoff waypoint:180,0,30").by("fence-leg")
    assert "80.0 m of it outside all inclusions" in out.message


@drawn(st.lists(places, min_size=3, max_size=9, unique=True))
def test_what_outlines_that_cross_themselves_enclose(corners: list[Place]) -> None:
    """An odd number of turns encloses what an odd number of triangles to one corner covers."""
    outline = polygon(*corners)
    (area,) = areas_of(Fence((outline,)), FRAME)
    first, *others = FRAME.to_local(*np.transpose(outline.vertices))
    odd: BaseGeometry = shapely.Polygon()
    for edge in pairwise(others):
        odd = odd.symmetric_difference(shapely.Polygon([first, *edge]))
    assert area.shape.is_valid
    assert shapely.symmetric_difference(area.shape, odd).area < 1e-3


def test_a_polygon_without_an_area_lets_nothing_in() -> None:
    areas = areas_of(Fence((polygon((0, 0), (50, 50), (100, 100)),)), FRAME)
    free = free_area(areas, any_inclusion=False)
    assert free is not None
    assert free.area < 1e-6
    assert free_area((), any_inclusion=False) is None
    point = Fence((polygon((20, 0), (20, 0), (20, 0), inclusion=False),))  # encloses nothing
    case = given("takeoff row=9,25 return")
    beside = replace(case, mission=replace(case.mission, fence=point))
    assert not beside.by("fence-margin") + beside.by("fence-leg")
