"""Power of flight against the published curves, and the energy of a flight against its integral."""

from typing import cast

import numpy as np
import pytest
from conftest import SMALL, edited
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from faao_mav.arrays import Real
from faao_mav.plan import parse_plan
from faao_mav.plan.vehicle import PowerOptions
from faao_mav.power import FixedWing, PowerModel, RotaryWing
from faao_mav.validate.demands import EnergyUse, energy_use

TABLE = cast("RotaryWing", PowerOptions().model(hovers=True))
PLANE = cast("FixedWing", PowerOptions().model(hovers=False))


def published(v: float) -> float:
    """P(v) of the paper of 2019 with the rounded numbers of its text."""
    ratio = v**2 / (2 * 4.03**2)
    return float(
        79.86 * (1 + 3 * v**2 / 120**2)
        + 88.63 * ((1 + ratio**2) ** 0.5 - ratio) ** 0.5
        + 0.6 * 1.225 * 0.05 * 0.503 * v**3 / 2
    )


def test_powers_are_those_of_the_papers_and_of_measured_cruise() -> None:
    assert float(TABLE.level(np.array(0.0))) == pytest.approx(168.5, rel=5e-3)
    speeds = np.linspace(0, 30, 2001)
    theirs = np.array([published(v) for v in speeds])
    assert TABLE.level(speeds) == pytest.approx(theirs, rel=5e-4)
    model = FixedWing.fitted(100.0, 20.0, 5.0)
    speeds = np.linspace(10, 40, 3001)
    power = model.level(speeds, np.zeros_like(speeds))
    assert speeds[(power / speeds).argmin()] == pytest.approx(20.0, abs=0.01)
    assert power[1000] == pytest.approx(100.0)


@settings(max_examples=10)
@given(st.floats(50, 5000), st.floats(1, 20), st.floats(1, 2))
def test_two_measured_powers_are_kept(hover: float, at: float, more: float) -> None:
    bare = RotaryWing(TABLE.blade, TABLE.induced, 120.0, TABLE.induced_speed, 0.0, 20.0)
    still, moving = bare.level(np.array([0.0, at]))
    cruise = more * hover * moving / still
    fitted = TABLE.fitted(hover, cruise, at)
    assert float(fitted.level(np.array(0.0))) == pytest.approx(hover)
    assert float(fitted.level(np.array(at))) == pytest.approx(cruise)
    assert fitted.parasite >= -1e-9


@settings(max_examples=30)
@given(*[st.floats(-40, 40)] * 2, *[st.floats(-5, 5)] * 2)
def test_the_fixed_wing_is_that_of_the_paper(
    east: float, north: float, a_east: float, a_north: float
) -> None:
    v, a = np.array([east, north, 0.0]), np.array([a_east, a_north, 0.0])
    speed = np.linalg.norm(v)
    if speed < 3:  # V_min of the paper
        return
    across = a @ a - (a @ v) ** 2 / speed**2
    drag = 9.26e-4 * speed**3 + 2250 / speed * (1 + across / 9.8**2)
    gained = 10.0 * max(0.0, float(a @ v))
    assert float(PLANE(v, a)) == pytest.approx(drag + gained, rel=1e-3, abs=1e-6)


@settings(max_examples=20)
@given(
    st.sampled_from([TABLE, TABLE.fitted(200.0, 180.0, 12.0), PLANE]),
    st.floats(3, 30),
    *[st.floats(-3.2, 3.2)] * 2,
    st.floats(0, 5),
)
def test_derivatives_are_those_of_differences(
    model: PowerModel, speed: float, heading: float, across: float, size: float
) -> None:
    v, a = (
        r * np.array([np.cos(angle), np.sin(angle)])[:, None]
        for r, angle in ((speed, heading), (size, across))
    )
    at, h = model.partials(v, a), 1e-6
    level = np.vstack([v, [[0.0]]]).T, np.vstack([a, [[0.0]]]).T
    more = float((at.value - model(*level))[0])  # the growth of kinetic energy sets in smoothly
    assert -1e-9 <= more <= (model.mass / 2 if isinstance(model, FixedWing) else 0.0) + 1e-9
    for k, step in enumerate(h * np.eye(2)[:, :, None]):
        for high, low, gradient, hessian, of in (
            (model.partials(v + step, a), model.partials(v - step, a), at.by_v, at.by_vv, "by_v"),
            (model.partials(v, a + step), model.partials(v, a - step), at.by_a, at.by_aa, "by_a"),
        ):
            slope = (high.value - low.value) / (2 * h)
            assert gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-4)
            curved = (getattr(high, of) - getattr(low, of)) / (2 * h)
            assert hessian[[k, k + 1]] == pytest.approx(curved, rel=1e-4, abs=1e-2)


def flight(wind: float) -> tuple[Real, Real]:
    """Up at 2 m/s for 10 s, east faster and faster for 20 s, down at 1 m/s for 20 s."""
    t = np.linspace(0, 50, 5001)
    velocity = np.zeros((len(t), 3))
    velocity[t <= 10, 2], velocity[t > 30, 2] = 2.0, -1.0
    east = (t > 10) & (t <= 30)
    velocity[east, 0] = 0.5 * (t[east] - 10)
    velocity[:, 0] += wind
    return t, velocity


def used(wind: float) -> EnergyUse:
    battery = {"vehicle.power": {}, "vehicle.battery": {"capacity_wh": 4, "reserve": "30 %"}}
    found = energy_use(parse_plan(edited(SMALL, battery)), *flight(wind), (wind, 0.0))
    assert found is not None
    return found


def test_energy_is_the_integral_of_power() -> None:
    ramp = quad(lambda t: published(0.5 * t), 0, 20)[0]
    by_hand = 10 * (168.49 + 20 * 2) + ramp + 20 * 168.49 + 50 * 0.1  # 0.1 W of the radio
    found = used(0.0)
    assert found.total * 3600 == pytest.approx(by_hand, rel=1e-3)
    assert (np.diff(found.used) > 0).all()
    assert used(3.0).total == pytest.approx(found.total)  # carried along by it
    assert found.left == pytest.approx(1 - found.total / 4)
    assert found.as_dict()["reserve"] == pytest.approx(0.3)
    assert found.as_dict()["used_wh"] == found.total
    assert found.as_dict()["mean_power_w"] == pytest.approx(by_hand / 50, rel=1e-3)
