"""Fences in the plane, against plain distances."""

import math
from itertools import pairwise

import hypothesis.strategies as st
import numpy as np
import pytest
import shapely
from hypothesis import given
from judged import (
    COPTER,
    FRAME,
    LAND,
    PLANE,
    PX4,
    PX4_PLANE,
    TAKEOFF,
    Given,
    at,
    circle,
    do,
    fence,
    flown,
    having,
    mission,
    polygon,
    square,
    track,
)
from shapely.geometry.base import BaseGeometry

from faao_mav.autopilot import Vehicle
from faao_mav.mission.command import Command
from faao_mav.mission.fence_area import areas_of, free_area
from faao_mav.validate.context import ValidationContext

metres = st.floats(-500, 500)
places = st.tuples(metres, metres)


def distance_to_segment(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    along = b - a
    if along @ along == 0:
        return math.dist(point, a)
    share = np.clip((point - a) @ along / (along @ along), 0, 1)
    return math.dist(point, a + share * along)


def broken(case: ValidationContext) -> list[bool]:
    return [bool(leaves) for leaves in case.fences[0].legs.leave]


@given(a=places, b=places, center=places, radius=st.floats(1, 300))
def test_a_leg_enters_a_circle_when_it_comes_nearer_than_the_radius(
    a: tuple[float, float], b: tuple[float, float], center: tuple[float, float], radius: float
) -> None:
    case = ValidationContext(
        mission(at(*a, 30), at(*b, 30), fence=fence(circle(*center, radius))), COPTER
    )
    nearest = distance_to_segment(np.array(center), np.array(a), np.array(b))
    spare = nearest - radius
    if abs(spare) > 1e-3 * radius:
        assert broken(case)[1] == (spare < 0)


@given(a=places, b=places, center=places, radius=st.floats(1, 1000))
def test_a_leg_stays_in_a_circle_when_its_ends_do(
    a: tuple[float, float], b: tuple[float, float], center: tuple[float, float], radius: float
) -> None:
    inside = circle(*center, radius, inclusion=True)
    case = ValidationContext(mission(at(*a, 30), at(*b, 30), fence=fence(inside)), COPTER)
    spare = radius - max(math.dist(center, a), math.dist(center, b))
    if abs(spare) > 1e-3 * radius:
        assert broken(case)[1] == (spare < 0)


def test_circles_err_on_the_safe_side() -> None:
    inclusion, exclusion = areas_of(
        fence(circle(0, 0, 100, inclusion=True), circle(0, 0, 100)), FRAME
    )
    assert inclusion.shape.area < math.pi * 100**2 < exclusion.shape.area
    assert inclusion.shape.area == pytest.approx(exclusion.shape.area, rel=1e-3)


@pytest.mark.parametrize("spare", [3.0, 25.0, 40.0])
def test_the_margin_is_the_distance_to_the_nearest_edge(spare: float) -> None:
    inside = Given(flown(at(0, 100 - spare, 30), fence=fence(square(200))))
    around = Given(flown(at(0, 100, 30), fence=fence(circle(50 + spare, 50, 50))))
    for given_ in (inside, around):
        (margin,) = given_.by("fence-margin")
        assert float(margin.message.split(" m ")[0]) == pytest.approx(spare, abs=0.06)


def test_the_margin_is_that_of_the_nearest_of_many_areas() -> None:
    posts = [circle(40 + 20 * k, 30 * (k % 9), 5) for k in range(255)]
    legs = [at(0, 25 * k, 30) for k in range(1, 10)]
    (margin,) = Given(flown(*legs, fence=fence(square(20_000), *posts))).by("fence-margin")
    assert margin.message.startswith("35.0 m")
    point = polygon((20, 0), (20, 0), (20, 0), inclusion=False)  # encloses nothing
    assert Given(flown(*legs, fence=fence(point))).by("fence-margin") == []
    (margin,) = Given(flown(*legs, fence=fence(point, posts[0]))).by("fence-margin")
    assert margin.message.startswith("35.0 m")


def test_of_many_areas_that_a_leg_breaks_three_are_named() -> None:
    nested = [circle(0, 60, 10 + k) for k in range(100)]
    (out,) = Given(flown(at(0, 300, 30), fence=fence(*nested))).by("fence-leg")[:1]
    assert out.message.count("m of it inside exclusion circle") == 3


def test_the_flight_counts_for_the_margin() -> None:
    bulge = track(((0, 0, 0), (60, 50, 30), (0, 100, 30)), [0, 1], 5.0)
    given_ = Given(flown(at(0, 100, 30), fence=fence(square(300))), track=bulge)
    assert given_.by("fence-margin")[0].message.startswith("50.0 m")
    closer = Given(given_.mission, track=track(((0, 0, 0), (120, 50, 30)), [1], 5.0))
    (margin,) = closer.by("fence-margin")
    assert margin.message.startswith("30.0 m")
    assert margin.item == 2


def test_legs_by_jumps_count() -> None:
    around = [at(-90, 60, 30), at(-90, 0, 30), at(90, 0, 30), at(90, 60, 30), at(0, -60, 30)]
    back = do(Command.DO_JUMP, 2, 1)
    found = Given(flown(*around, back, fence=fence(circle(-22, -30, 10)))).by("fence-leg")
    assert [finding.item for finding in found] == [7]
    assert "by a jump" in found[0].message


@pytest.mark.parametrize("command", [17, 18, 19, 31])
@pytest.mark.parametrize("vehicle", [PLANE, PX4_PLANE])
def test_circles_of_planes_count(vehicle: Vehicle, command: int) -> None:
    radius = (0, 150, 0) if command == 31 else (0, 0, 150)
    circling = at(600, 0, 60, *radius, command=command)
    zone = fence(circle(600, 140, 30))
    found = Given(mission(TAKEOFF, circling, fence=zone), vehicle).by("fence-circle")
    assert [finding.item for finding in found] == [2]
    center = fence(circle(600, 0, 60))  # round what is not to be flown over
    assert not Given(mission(TAKEOFF, circling, fence=center), vehicle).by("fence-circle")
    assert not Given(mission(TAKEOFF, circling, fence=center), vehicle).by("fence-leg")


def test_a_plane_circles_where_it_returns_and_where_it_ends() -> None:
    zone = fence(circle(0, 60, 10))
    around = having(PLANE, WP_LOITER_RAD=60)
    assert Given(flown(at(900, 0, 60), fence=zone), around).by("fence-circle")
    assert not Given(flown(at(900, 0, 60), fence=zone), COPTER).by("fence-circle")
    there = fence(circle(900, 60, 10))
    assert Given(mission(TAKEOFF, at(900, 0, 60), fence=there), around).by("fence-circle")
    assert not Given(mission(TAKEOFF, at(900, 0, 60), LAND, fence=there), around).by("fence-circle")


def test_one_inclusion_is_enough_for_px4_only() -> None:
    two = fence(square(100), square(100, east=80))
    case = ValidationContext(flown(at(90, 0, 30), fence=two), PX4)
    assert not any(broken(case))
    assert any(broken(ValidationContext(case.mission, COPTER)))
    assert not any(broken(ValidationContext(case.mission, having(COPTER, FENCE_OPTIONS=2))))
    apart = fence(square(100), square(100, east=180))
    between = Given(flown(at(180, 0, 30), fence=apart), PX4).by("fence-leg")
    assert "80.0 m of it outside all inclusions" in between[0].message


def test_a_bow_tie_keeps_both_halves() -> None:
    (area,) = areas_of(fence(polygon((0, 0), (100, 100), (100, 0), (0, 100))), FRAME)
    assert area.crosses_itself
    assert area.shape.area == pytest.approx(5000, rel=1e-3)


@given(st.lists(places, min_size=3, max_size=9, unique=True))
def test_what_outlines_that_cross_themselves_enclose(corners: list[tuple[float, float]]) -> None:
    """An odd number of turns encloses what an odd number of triangles to one corner covers."""
    drawn = fence(polygon(*corners))
    (area,) = areas_of(drawn, FRAME)
    first, *others = FRAME.to_local(*np.transpose(drawn.polygons[0].vertices))
    odd: BaseGeometry = shapely.Polygon()
    for edge in pairwise(others):
        odd = odd.symmetric_difference(shapely.Polygon([first, *edge]))
    assert area.shape.is_valid
    assert shapely.symmetric_difference(area.shape, odd).area < 1e-3


def test_a_polygon_without_an_area_lets_nothing_in() -> None:
    areas = areas_of(fence(polygon((0, 0), (50, 50), (100, 100))), FRAME)
    free = free_area(areas, any_inclusion=False)
    assert free is not None
    assert free.area < 1e-6
    assert free_area((), any_inclusion=False) is None
