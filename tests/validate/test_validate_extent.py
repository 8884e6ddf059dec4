"""How high, how far, how long."""

import numpy as np
import pytest
from judged import (
    COPTER,
    LAND,
    PLANE,
    PX4,
    Given,
    at,
    check,
    flown,
    having,
    mission,
    raw,
    track,
)

from faao_mav.autopilot import Track
from faao_mav.mission.item import Home
from faao_mav.plan.energy import Battery
from faao_mav.validate import Limits
from faao_mav.validate.energy import EnergyUse


def flight(*points: tuple[float, float, float]) -> Track:
    return track(points, range(len(points) - 1), 5.0)


def taking(watt_hours: float, least_power: float = 0.0) -> EnergyUse:
    """A flight of an hour at an even power, with a battery of 100 Wh of which 20 % are kept."""
    t, power, used = np.array([0.0, 3600.0]), np.full(2, watt_hours), np.array([0.0, watt_hours])
    return EnergyUse(t, power, used, Battery(capacity_wh=100), True, least_power)


# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    ("below-home", Given(flown(at(0, 9, -0.1))), 2, Given(flown(at(0, 9, 0), LAND))),
    ("near-ground", Given(flown(at(0, 9, 1e-9))), 2, Given(flown(at(0, 9, 1), LAND))),
    ("near-ground", Given(mission(at(0, 0, -1, command=22))), 1, Given(flown(at(0, 9, -1)))),
    ("too-high", Given(flown(at(0, 9, 1e6)), PX4), 2, Given(flown(at(0, 9, 2e4)), PX4)),
    (
        "above-ceiling",
        Given(flown(at(0, 9, 50.1)), limits=Limits(max_altitude=50)),
        2,
        Given(flown(at(0, 9, 50)), limits=Limits(max_altitude=50)),
    ),
    (
        "predicted-beyond",
        Given(
            flown(at(0, 9, 50)),
            track=flight((0, 0, 0), (0, 0, 51.1)),
            limits=Limits(max_altitude=50),
        ),
        1,
        Given(
            flown(at(0, 9, 50)),
            track=flight((0, 0, 0), (0, 0, 50.9)),
            limits=Limits(max_altitude=50),
        ),
    ),
    ("above-120-m", Given(flown(at(0, 9, 121))), 2, Given(flown(at(0, 9, 120)))),
    (
        "return-above-ceiling",
        Given(flown(), limits=Limits(max_altitude=14.9)),
        None,
        Given(flown(), limits=Limits(max_altitude=15)),
    ),
    (
        "return-above-ceiling",
        Given(flown(), PX4, limits=Limits(max_altitude=59)),
        None,
        Given(flown(), PX4, limits=Limits(max_altitude=60)),
    ),
    (
        "return-above-ceiling",
        Given(flown(), having(COPTER, RTL_ALT=6000), limits=Limits(max_altitude=59)),
        None,
        Given(flown(), having(COPTER, RTL_ALT=5900), limits=Limits(max_altitude=59)),
    ),
    (
        "beyond-distance",
        Given(flown(at(0, 100.1, 30)), limits=Limits(max_distance=100)),
        2,
        Given(flown(at(0, 99.9, 30)), limits=Limits(max_distance=100)),
    ),
    (
        "predicted-beyond",
        Given(flown(), track=flight((0, 0, 0), (0, 101.1, 9)), limits=Limits(max_distance=100)),
        1,
        Given(flown(), track=flight((0, 0, 0), (0, 100.9, 9)), limits=Limits(max_distance=100)),
    ),
    ("too-far", Given(flown(at(0, 100_100, 30))), 2, Given(flown(at(0, 99_900, 30)))),
    (
        "too-far",
        Given(flown(at(0, 1_100_000, 30)), PLANE),
        2,
        Given(flown(at(0, 500_000, 30)), PLANE),
    ),
    ("far-from-home", Given(flown(at(0, 10_001, 30))), 2, Given(flown(at(0, 9_999, 30)))),
    (
        "long-leg",
        Given(flown(at(0, -5_001, 30), at(0, 5_000, 30))),
        3,
        Given(flown(at(0, -4_999, 30), at(0, 5_000, 30))),
    ),
    (
        "too-long",
        Given(flown(at(0, 100, 30, 10)), limits=Limits(max_duration=41.9)),
        None,
        Given(flown(at(0, 100, 30, 10)), limits=Limits(max_duration=42.1)),
    ),
    (
        "too-long",  # a tail wind makes it quicker than the commanded speeds
        Given(
            flown(at(0, 100, 30, 10)),
            track=flight((0, 0, 0), (0, 215, 0)),
            limits=Limits(max_duration=41.9),
        ),
        None,
        Given(
            flown(at(0, 100, 30, 10)),
            track=flight((0, 0, 0), (0, 205, 0)),
            limits=Limits(max_duration=41.9),
        ),
    ),
    (
        "predicted-beyond",
        Given(flown(), track=flight((0, 0, 0), (0, 65, 0)), limits=Limits(max_duration=11.8)),
        1,
        Given(flown(), track=flight((0, 0, 0), (0, 65, 0)), limits=Limits(max_duration=12.2)),
    ),
    (
        "battery-reserve",  # 42 s at least
        Given(flown(at(0, 100, 30, 10)), energy=taking(90, 6870)),
        None,
        Given(flown(at(0, 100, 30, 10)), energy=taking(90, 6850)),
    ),
    (
        "battery-tight",
        Given(flown(), energy=taking(80.1)),
        None,
        Given(flown(), energy=taking(79.9)),
    ),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)


def test_exchanged_coordinates_are_named() -> None:
    home = Home(47.4, 8.5, 400.0)
    (found,) = Given(mission(raw(8.5012, 47.4003, 30), home=home)).by("too-far")
    assert found.action == "latitude and longitude look exchanged: correct them"
