"""Flights to start from by way of the stations."""

from typing import Any

import numpy as np
import pytest

from faao_mav.optimizer.kinematics import Kinematics
from faao_mav.optimizer.search.starts import starts

STATIONS = {"bs": np.array([0.0, 0.0]), "user": np.array([300.0, 300.0])}
NAMES = ["straight", "bs", "user", "bs-user", "user-bs"]


def kin(seconds: float, **changes: Any) -> Kinematics:
    values: dict[str, Any] = {
        "start": np.array([0.0, 350.0]),
        "end": np.array([350.0, 0.0]),
        "slots": round(seconds / 0.5),
        "time_step": 0.5,
        "max_speed": 8.0,
        "max_acceleration": 1.5,
        "start_velocity": np.zeros(2),
        "end_velocity": np.zeros(2),
        "bound_first_acceleration": True,
    }
    return Kinematics(**(values | changes))


@pytest.mark.parametrize("seconds", [68.0, 75.0, 120.0, 300.0])
@pytest.mark.parametrize("free", [True, False])
def test_every_start_can_be_flown(seconds: float, free: bool) -> None:
    changes = {"start_velocity": None, "end_velocity": None} if free else {}
    k = kin(seconds, **changes)
    found = starts(k, NAMES, STATIONS)
    assert "straight" in found
    for flight in found.values():
        assert max(k.residuals(flight).values()) < 1e-9


def test_with_time_the_stations_are_visited_in_order_and_hovered_at() -> None:
    found = starts(kin(300), NAMES, STATIONS)
    assert list(found) == NAMES
    at = {
        name: [np.linalg.norm(found[name].w - p, axis=1).argmin() for p in STATIONS.values()]
        for name in ("bs-user", "user-bs")
    }
    assert at["bs-user"][0] < at["bs-user"][1]
    assert at["user-bs"][0] > at["user-bs"][1]
    for p in STATIONS.values():
        near = np.linalg.norm(found["bs-user"].w - p, axis=1) < 1e-6
        assert near.sum() > 20


def test_with_less_time_it_goes_as_far_as_it_can() -> None:
    shares = []
    for seconds in (75.0, 80.0, 90.0, 120.0):  # a stop on the way alone takes 5 s
        flight = starts(kin(seconds), ["bs"], STATIONS)["bs"]
        shares.append(np.linalg.norm(flight.w - STATIONS["bs"], axis=1).min())
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 100
    assert shares[-1] < 1e-6


def test_what_cannot_be_had_is_left_out() -> None:
    assert list(starts(kin(68.0), ["bs", "user"], STATIONS)) == ["straight"]
    across = kin(300, start_velocity=np.array([1.0, 1.0]))
    assert list(starts(across, ["bs"], STATIONS)) == ["straight"]
