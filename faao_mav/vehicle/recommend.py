"""Which autopilot parameters a mission is timed for.

An autopilot whose ramps take longer than the plan's falls behind at every one; one that turns
corners at a crawl does so in every curve. Few parameters decide that: the limits of acceleration
and jerk, and for PX4 how far it may fall behind before it slows down and how well it has to meet
a waypoint's altitude.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from faao_mav.plan import Plan

_GENTLE = (1.35, 2.0)
"""Of a_max: the first makes up for the time that a jerk-limited ramp loses."""

_CURVED = {"ardupilot": 4.0, "px4": 5.0}
"""m/s²: corners and short legs at speed."""

_RANGE = {"ardupilot": (0.5, 5.0), "px4": (2.0, 15.0)}
"""m/s²: what the autopilots accept."""

FASTEST = 20.0
"""The greatest speed that both autopilots can be told, m/s."""

_HEADROOM = 1.1
"""Of the plan's greatest speed: what a schedule may command."""

_PX4_TOP = 12.0
"""PX4's own MPC_XY_VEL_MAX, m/s, which caps every speed."""

_JERK = {"ardupilot": 10.0, "px4": 20.0}


def candidates(plan: "Plan") -> tuple[Mapping[str, float], ...]:
    """Return sets of parameters to try, the gentlest first; one empty set for `keep`.

    Likewise for aeroplanes: how they turn and how fast they may fly is tuned on each.

    ArduPilot's have the names of both generations: a vehicle takes those that it knows.
    """
    if plan.mission.parameters == "keep" or plan.vehicle.type == "plane":
        return ({},)
    autopilot, limit = plan.vehicle.autopilot, plan.vehicle.max_acceleration
    low, high = _RANGE[autopilot]
    tried = dict.fromkeys(
        round(min(max(acceleration, low), high), 2)
        for acceleration in (*(share * limit for share in _GENTLE), _CURVED[autopilot])
    )
    named = _ardupilot if autopilot == "ardupilot" else _px4
    return tuple(named(plan, acceleration) for acceleration in sorted(tried))


def _ardupilot(plan: "Plan", acceleration: float) -> dict[str, float]:
    speed, jerk = min(plan.vehicle.max_speed, FASTEST), _JERK["ardupilot"]
    return {
        "WPNAV_SPEED": round(100 * speed),
        "WPNAV_ACCEL": round(100 * acceleration),
        "WPNAV_JERK": jerk,
        "WP_SPD": speed,
        "WP_ACC": acceleration,
        "WP_JERK": jerk,
    }


def _px4(plan: "Plan", acceleration: float) -> dict[str, float]:
    speed = min(plan.vehicle.max_speed, FASTEST)
    top = min(_HEADROOM * speed, FASTEST)
    return {
        "MPC_XY_CRUISE": speed,
        **({"MPC_XY_VEL_MAX": round(top, 2)} if top > _PX4_TOP else {}),
        "MPC_ACC_HOR": acceleration,
        "MPC_JERK_AUTO": _JERK["px4"],
        "MPC_XY_ERR_MAX": 10.0,
        "NAV_MC_ALT_RAD": 3.0,
    }
