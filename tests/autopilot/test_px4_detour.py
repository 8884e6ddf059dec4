"""Where PX4 heads for on a leg that it enters away from it."""

import numpy as np
import pytest
from flight_paths import path_of

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.px4 import Px4, Px4Legs
from faao_mav.autopilot.px4.detour import Heading, excess, headed, heading
from faao_mav.autopilot.px4.guidance import GuidedLeg, legs

SUITED = Px4(acceleration=5, jerk=20, error_limit=10, height_radius=3)


@pytest.fixture
def leg() -> GuidedLeg:
    """A leg to the east from 0 to 50 m, whose end has a radius of 2 m."""
    points = np.array([[0.0, 0, 30], [50, 0, 30], [50, 60, 30]])
    return legs(SUITED, points, [2.0, 2.0, 2.0], [8.0, 8.0], [0.0, 0.0, 0.0])[0]


@pytest.mark.parametrize(
    ("place", "kind"),
    [
        (20 + 1j, Heading.END),
        (-1.5 + 1j, Heading.END),  # within the radius of its beginning
        (-3 + 0j, Heading.BEGINNING),
        (-3 + 9j, Heading.BEGINNING),
        (20 - 3j, Heading.ONTO),
        (51 + 0j, Heading.PAST),
        (51 + 9j, Heading.PAST),
    ],
)
def test_what_it_heads_for(leg: GuidedLeg, place: complex, kind: Heading) -> None:
    assert heading(leg, place) is kind
    if kind is not Heading.END:
        assert excess(kind, leg, place) > 0


def test_a_detour_ends_at_the_beginning_or_on_the_leg(leg: GuidedLeg) -> None:
    back = headed(SUITED, leg, Heading.BEGINNING, -3 + 4j)
    assert (back.target, back.onward) == (0, 1)
    assert back.along == pytest.approx((3 - 4j) / 5)
    onto = headed(SUITED, leg, Heading.ONTO, 20 - 3j)
    assert (onto.target, onto.along, onto.onward) == (20, 1j, 1)
    assert headed(SUITED, leg, Heading.END, 20 - 3j) is leg
    assert headed(SUITED, leg, Heading.PAST, 53 + 4j).along == pytest.approx(-(3 + 4j) / 5)


def slowest_near(radii: list[float], corner: int) -> float:
    path = path_of([0, 50, 50 + 50 * np.exp(0.26j), 200])
    path.radii[:] = radii
    flown = SUITED.fly(path)
    about = abs(flown.t - flown.arrivals[corner]) < 2.5
    return float(np.linalg.norm(flown.velocity[about], axis=1).min())


def test_a_wide_radius_before_a_small_one_costs_speed() -> None:
    # Flown by PX4 at 8 m/s round 15 degrees: 5.6 m/s with 9.9 m before 1.5 m.
    assert slowest_near([2, 9.9, 1.5, 2], 1) == pytest.approx(5.6, abs=0.5)
    assert slowest_near([2, 9.9, 9.9, 2], 1) > 7.5


def narrowing(radii: Real, turn: Real, stops: Flags) -> list[bool]:
    corners = (turn > 0.1) & ~stops
    return [bool(radii[k] > radii[k + 1] + 1e-9) for k in np.flatnonzero(corners[:-1])]


@pytest.mark.parametrize("seed", range(5))
def test_radii_are_a_metre_at_least_and_none_narrows_in_a_corner(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room, turn = rng.uniform(1, 100, 12), rng.uniform(0, 3, 12) * (rng.uniform(size=12) < 0.7)
    stops = rng.uniform(size=12) < 0.2
    stops[[0, -1]] = True
    radii = Px4Legs(acceleration=5.0, jerk=20.0).radii(room, turn, stops)
    assert radii.min() >= 1.0
    assert not any(narrowing(radii, turn, stops))
