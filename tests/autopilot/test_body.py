"""The airframe that flights are predicted with."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flight_paths import line, path_of
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.body import PX4_BODY, CopterBody, PlaneBody
from faao_mav.autopilot.px4 import Px4
from faao_mav.power import GRAVITY

DRAGS = {"linear_drag": st.floats(0, 2), "quadratic_drag": st.floats(0, 0.1)}
COPTERS = st.builds(CopterBody, lag=st.floats(0.05, 1), **DRAGS)
PLANES = st.builds(
    PlaneBody,
    airspeed_lag=st.floats(0.05, 5),
    sideslip=st.floats(0, 0.9),
    airspeed_exponent=st.floats(0, 2),
)


@given(COPTERS, st.floats(math.radians(5), math.radians(80)))
def test_at_the_top_airspeed_drag_takes_all_of_the_lean(body: CopterBody, lean: float) -> None:
    top = body.top_airspeed(lean)
    drag = (body.linear_drag + body.quadratic_drag * top) * top
    assert math.isinf(top) or drag == pytest.approx(GRAVITY * math.tan(lean), rel=1e-6)


@pytest.mark.parametrize("drag", [0.4, 0.7])
def test_arducopter_gets_no_faster_than_its_body(drag: float) -> None:
    vehicle = Vehicle(body=CopterBody(linear_drag=drag))
    flown = vehicle.flight_model().fly(line(1500, 1, 20.0))
    fastest = np.hypot(*flown.velocity[:, :2].T).max()
    assert fastest == pytest.approx(vehicle.top_airspeed, rel=0.03)


def test_px4s_drag_may_grow_with_the_speed() -> None:
    """At one speed a drag that grows with it is the linear one."""
    bodies = [replace(PX4_BODY, linear_drag=k, quadratic_drag=q) for k, q in ((1, 0), (0, 0))]
    bodies.append(replace(PX4_BODY, linear_drag=0.0, quadratic_drag=0.2))
    flights = [Px4(body=each).fly(path_of([0, 150, 150 + 150j], 5.0)).position for each in bodies]
    n = min(map(len, flights))
    to_linear, to_none = (np.abs(flights[2][:n] - each[:n]).max() for each in flights[:2])
    assert to_linear < to_none / 2


@settings(max_examples=25, deadline=None)
@given(COPTERS, PLANES)
def test_whatever_the_body_a_flight_ends(copter: CopterBody, plane: PlaneBody) -> None:
    path = replace(path_of([0, 80, 80 + 80j, 200 + 80j], 8.0), longest=3000.0)
    for autopilot in ("ardupilot", "px4"):
        flown = Vehicle(autopilot, body=copter).flight_model().fly(path)
        assert np.abs(flown.position[-1, :2] - [200, 80]).max() < 5
    path = replace(path_of([0, 600, 600 + 600j], 15.0), longest=3000.0)
    assert np.isfinite(Vehicle(kind="plane", body=plane).flight_model().fly(path).position).all()
