"""Plans and trajectories for the tests of missions."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from hypothesis import settings

from faao_mav.arrays import Real
from faao_mav.mission import Mission, assemble, plan_route
from faao_mav.plan import (
    BaseStation,
    Flight,
    GroundUser,
    MissionOptions,
    Optimizer,
    Origin,
    Plan,
    Radio,
    Relay,
    Vehicle,
)

STEADY = settings(derandomize=True, deadline=None, max_examples=200)
"""The same examples on every run."""

Trajectory: TypeAlias = tuple[Real, Real]


def plan_with(
    *,
    origin: tuple[float, float, float] = (-35.363262, 149.165237, 584.0),
    autopilot: Any = "ardupilot",
    max_speed: float = 8.0,
    parameters: Mapping[str, float] | None = None,
    takeoff: bool = True,
    on_finish: Any = "rtl",
    path_tolerance: float = 2.0,
    max_items: int = 600,
) -> Plan:
    """Return a plan; the radio and the flight's ends play no part in a mission."""
    return Plan(
        origin=Origin(*origin),
        vehicle=Vehicle(
            max_speed, 1.5, autopilot=autopilot, parameters=parameters if parameters else {}
        ),
        flight=Flight((0.0, 350.0), (350.0, 0.0), 100.0, 120.0, 0.2, None, None, True),
        radio=Radio(
            BaseStation((0.0, 0.0), 2, 0.1),
            Relay(2, 0.1, 1e-11),
            GroundUser((300.0, 300.0), 2, 1e-11),
            *("bpsk", 1e-5, 3.0, "ula", "none", 1, "statistical", 0, False),
        ),
        optimizer=Optimizer("direct", "faao", "alphabet", ("straight",), 1e-4, 50),
        mission=MissionOptions(takeoff, on_finish, path_tolerance, max_items, "keep"),
    )


def dash(begin: float, end: float, top: float, acceleration: float, t: Real) -> Real:
    """Return positions along a line, from rest to rest, as fast as the limits allow."""
    length = end - begin
    top = min(top, float(np.sqrt(length * acceleration)))
    ramp = top / acceleration
    cruise = (length - top * ramp) / top
    speeds = ([0.0, ramp, ramp + cruise, 2 * ramp + cruise], [0.0, top, top, 0.0])
    fine = np.linspace(0.0, speeds[0][-1], 20_001)
    v = np.interp(fine, *speeds)
    s = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * np.diff(fine))])
    return begin + np.interp(t, fine, s)


def dash_hover_dash(hover: float = 40.0, step: float = 0.2) -> Trajectory:
    """Return two dashes of 250 m with a hover of about `hover` seconds between them."""
    lasting = 250 / 8 + 8 / 1.5
    t = np.arange(0.0, 2 * lasting + hover + step, step)
    first = dash(0.0, 250.0, 8.0, 1.5, t)
    second = dash(0.0, 250.0, 8.0, 1.5, np.maximum(t - lasting - hover, 0.0))
    w = np.outer(first, [0.6, -0.8]) + np.outer(second, [0.8, 0.6]) + [0.0, 350.0]
    return t, w


def mission_of(t: Real, w: Real, plan: Plan) -> Mission:
    """Return the mission that flies a bare trajectory."""
    return assemble(plan_route(t, w, plan), plan)
