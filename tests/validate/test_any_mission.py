"""Any mission can be judged, for any vehicle."""

import math
from dataclasses import replace

import hypothesis.strategies as st
from hypothesis import given, settings
from judged import HOME, VEHICLES, track

from faao_mav.mission.command import Command
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.validate import Limits, ValidationContext, validate

odd = st.sampled_from([0.0, -0.0, math.nan, 1e-320, 1e300, -1e300, -1.0, 1.0, 2.7, 255.5, 65_536.0])
values = st.one_of(odd, st.floats(-200, 200), st.floats(allow_infinity=False))
commands = st.one_of(st.sampled_from([*Command]), st.integers(0, 65_535))
latitudes = st.one_of(odd, st.floats(-90, 90), st.floats(-35.4, -35.3))
longitudes = st.one_of(odd, st.floats(-180, 180), st.floats(149.1, 149.2))
items = st.builds(
    MissionItem,
    command=commands,
    frame=st.one_of(st.sampled_from([0, 2, 3, 5, 6, 10, 11]), st.integers(0, 255)),
    params=st.tuples(values, values, values, values),
    x=latitudes,
    y=longitudes,
    z=values,
    autocontinue=st.booleans(),
)
places = st.one_of(
    st.tuples(st.floats(-90, 90), st.floats(-180, 180)),
    st.tuples(st.floats(-35.4, -35.3), st.floats(149.1, 149.2)),
)
points = places.map(lambda place: RallyPoint(*place, 50.0))
homes = st.none() | st.just(HOME) | places.map(lambda place: Home(*place, -500.0))
outlines = st.lists(places, min_size=3, max_size=6).map(tuple)
fences = st.builds(
    Fence,
    polygons=st.lists(st.builds(Polygon, outlines, st.booleans()), max_size=3).map(tuple),
    circles=st.lists(
        st.builds(Circle, places, st.floats(1e-3, 1e7), st.booleans()), max_size=3
    ).map(tuple),
    breach_return=st.none() | points,
)
missions = st.builds(
    Mission,
    items=st.lists(items, max_size=12).map(tuple),
    home=homes,
    fence=st.just(Fence()) | fences,
    rally=st.lists(points, max_size=2).map(tuple),
)
ZEROS = ("WPNAV_SPEED", "WPNAV_ACCEL", "WPNAV_JERK", "MPC_ACC_HOR", "MPC_JERK_AUTO", "NAV_ACC_RAD")
STRICT = dict.fromkeys(ZEROS, 0.0) | {
    "ARMING_MIS_ITEMS": 127.0,
    "FENCE_ENABLE": 1.0,
    "FENCE_TYPE": 15.0,
    "MIS_TKO_LAND_REQ": 3.0,
    "GF_MAX_HOR_DIST": 10.0,
    "GF_MAX_VER_DIST": 10.0,
}
LIMITS = Limits(1.0, 50.0, 20.0, 5.0, 2.0)


@given(mission=missions, bare=st.booleans(), flown=st.booleans())
@settings(max_examples=30)
def test_any_mission_can_be_judged(mission: Mission, bare: bool, flown: bool) -> None:
    flight = track(((0, 0, 0), (0, 0, 30), (0, 90, 30)), [0, 1], 5.0)
    known = flight if flown and len(mission.items) >= 2 else None
    for vehicle in VEHICLES:
        judged = vehicle if bare else replace(vehicle, parameters=STRICT)
        limits = Limits() if bare else LIMITS
        found = validate(ValidationContext(mission, judged, known, limits))
        for finding in found:
            assert finding.item is None or 1 <= finding.item <= len(mission.items)
