"""PX4: what its multicopters and planes are, what it does with items, and how a multicopter flies.

The flight model is PX4's own chain: `guidance` asks for a velocity and follows it within jerk and
acceleration, `flight_model` has the aircraft that follows that trajectory. Source: behaviour of
PX4's modules navigator and flight_mode_manager (FlightTaskAuto) and its library motion_planning,
read at several revisions about 1.16; controller gains are PX4's documented defaults. Flights: PX4
1.16 in simulation.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.body import PX4_BODY
from faao_mav.autopilot.dialect import Dialect, Limit, SpeedChange, commands_of
from faao_mav.autopilot.manners import (
    FenceAction,
    LossAction,
    Manners,
    Modes,
    SetpointRules,
    failsafes,
    meanings_of,
)
from faao_mav.autopilot.parameter import ParameterValues, Recommended, parameters_of, table
from faao_mav.autopilot.px4.flight_model import Px4 as Px4
from faao_mav.autopilot.px4.guidance import FACTS
from faao_mav.autopilot.vehicle_type import (
    AutopilotFamily,
    FenceResponse,
    RallyRule,
    VehicleType,
    orbit_at,
)
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import FLOWN_TO, Command, Frame

_RADIUS = 6_371_000.0  # The radius of PX4's Earth, m.


def px4_mode(main: int, sub: int) -> int:
    """Return PX4's custom mode for a main and a sub mode; 0 for numbers that are none."""
    return main << 16 | sub << 24 if 0 <= main < 256 and 0 <= sub < 256 else 0


_HOLD, _RETURN, _LAND = (px4_mode(4, sub) for sub in (3, 5, 6))

PX4 = AutopilotFamily(
    key="px4",
    name="PX4",
    mav_autopilot=12,
    parameter_suffix=".params",
    parameter_style="qgroundcontrol",
    parameter_prefixes=("MPC_", "NAV_", "COM_", "EKF2_"),
    manners=Manners(
        request_period=0.25,
        patience=5.0,
        ignores_other_items=True,
        final_acks=2,  # until it hears one, nobody else can begin a transfer for 5 s
        meanings=meanings_of("px4"),
    ),
    has_submodes=True,
    setpoints=SetpointRules(
        "COM_OF_LOSS_T",
        most_timeout=60.0,  # the greatest value that it takes
        loss="COM_OBL_RC_ACT",
        actions={  # without sticks PX4 1.16.1 sank in Position by 0.7 m/s to the ground
            0: LossAction("Position", px4_mode(3, 0), by_sticks=True),
            1: LossAction("Altitude", px4_mode(2, 0), by_sticks=True),
            2: LossAction("Stabilized", px4_mode(7, 0), by_sticks=True),
            3: LossAction("Return", _RETURN),
            4: LossAction("Land", _LAND),
            5: LossAction("Hold", _HOLD),
        },
        forbidden={6: "terminates the flight", 7: "stops its motors"},
        streamed=1.0,
        defaults={"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 0},
    ),
    local_frame=lambda latitude, longitude: LocalFrame(latitude, longitude, _RADIUS),
    whole_as_bits=True,
    mavlink_2="MAV_PROTO_VER 2",
)
"""PX4, whatever it flies. Manners: `mavlink_mission.cpp` (behaviour only), and what it did in its
simulator."""

_MODES = Modes(
    rest=_HOLD,
    mission=px4_mode(4, 4),
    hold=_HOLD,
    at_fence={"hold": _HOLD, "return": _RETURN, "land": _LAND},
    at_end=frozenset({_HOLD, _RETURN, _LAND}),
    guided=px4_mode(6, 0),
    not_to_arm_in=frozenset(px4_mode(4, sub) for sub in (2, 5, 6, 9)),
)
"""PX4 1.16 does not arm in Return, Land and Precision Land, and takes off in Takeoff."""

_AT_FENCE: tuple[FenceAction, ...] = ("nothing", "report", "hold", "return", "terminate", "land")
"""What each value of GF_ACTION means."""


def _at_fence(vehicle: ParameterValues) -> FenceResponse:
    number = int(vehicle.value("fence_action"))
    action = _AT_FENCE[number] if number in range(len(_AT_FENCE)) else "nothing"
    response = FenceResponse(action, "fence_action")
    return response if response.keeps else replace(response, set_to="2 (hold) or 3 (return)")


def _fence_ahead(vehicle: ParameterValues, speed: Real) -> Real:
    """How far it is to a stop, by PX4's own estimate; 0 unless GF_PREDICT is set.

    The aircraft is taken to accelerate as hard as it may: that ends by the jerk j, then it brakes.
    At v = 7 m/s and defaults that is 33.6 m; in simulation it broke off 31.9 m before the fence.
    """
    if vehicle.value("fence_predict") == 0:
        return 0 * speed
    limit, jerk = vehicle.value("acceleration"), vehicle.value("jerk")
    first = max(limit, vehicle.value("greatest_acceleration"))
    fastest = speed + first**2 / (2 * jerk)
    to_fastest = speed * first / jerk + first**3 / (3 * jerk**2)
    peak = np.minimum(limit, np.sqrt(fastest * jerk))  # of the acceleration while it brakes
    braking = fastest / 2 * (fastest / peak + peak / jerk)
    return np.asarray(to_fastest + braking + FACTS.fence_checks * speed)


def _rally(vehicle: ParameterValues) -> RallyRule:
    """Return where a return goes, by RTL_TYPE (PX4 1.16).

    0 and 3 take the nearest of home and rally points, 1 a rally point before home, others (by a
    mission's landing, or back along it) none.
    """
    kind = int(vehicle.value("return_type"))
    return RallyRule(math.inf if kind in (0, 1, 3) else -1.0, home=kind != 1)


LEAST_TAKEOFF: float = FACTS.least_takeoff

CONDITIONS = (Command.CONDITION_DELAY, Command.CONDITION_DISTANCE)
"""Commands that it takes, and starts no mission with."""


FLIES = FLOWN_TO | {Command.NAV_RETURN_TO_LAUNCH, 187, 211, 4501, 42600}
"""What checkTakeoff counts as flying: actuators, grippers, winches and gates as well."""


_SEA, _HOME = Frame.GLOBAL_INT, Frame.GLOBAL_RELATIVE_ALT_INT

_PLACED, _UNPLACED = commands_of("px4")

DIALECT = Dialect(
    name="PX4",
    home_row=False,
    items=Limit(1_000, 10_000),  # most boards; the simulator, measured
    jumps=None,
    fence_rows=64,
    rally_rows=8,
    atomic=True,
    unset_is_zero=False,
    zero_means_here=False,
    placed=_PLACED,
    unplaced=_UNPLACED,
    frames={0: _SEA, 3: _HOME, 5: _SEA, 6: _HOME},
    idle_frames={2: Frame.MISSION},
    # whatever its type; what is not above 0 brings the default back
    speed_change=lambda item: SpeedChange("horizontal", x if (x := item.params[1]) > 0 else None),
)
"""Items with a place are taken in frames 0, 3, 5, 6; all others in frame 2, and only there."""

_px4_type = partial(
    VehicleType,
    family=PX4,
    name="PX4",
    dialect=DIALECT,
    # measured on 1.16.1
    home_outside_fence="PX4 says so (Geofence invalid), and flies the mission all the same",
    at_fence=_at_fence,
    failsafes=failsafes("px4"),
    rally=_rally,
)

PX4_COPTER = _px4_type(
    kind="copter",
    mav_types=(2, 3, 4, 13, 14, 15, 29, 35),
    modes=_MODES,
    hovers=True,
    parameters=table(*Px4.parameters(), *parameters_of("px4copter")),
    fence_ahead=_fence_ahead,
    flight_model=Px4.from_vehicle,
    recommendation=Recommended(
        5.0,
        (2.0, 15.0),
        {"jerk": 20.0, "error_limit": FACTS.error_limit, "height_radius": FACTS.height_radius},
    ),
    ceilings={"max_speed": ("max_speed",), "max_acceleration": ("lean_angle", "acceleration")},
    body=PX4_BODY,
)
"""A multicopter with PX4 1.16."""

PX4_PLANE = _px4_type(
    kind="plane",
    mav_types=(1,),
    modes=replace(_MODES, guided=None),
    hovers=False,
    parameters=table(*parameters_of("px4plane")),
    orbits=lambda vehicle, item, _: orbit_at(vehicle, item),
)
"""A plane with PX4 1.16: its missions can be validated, not made."""
