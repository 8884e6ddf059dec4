"""ArduPlane: what it is, and how it flies a mission."""

from faao_mav.autopilot.ardupilot import (
    ARDUPILOT,
    HOME_OUTSIDE_FENCE,
    at_fence,
    needs_one_inclusion,
    rally_rule,
)
from faao_mav.autopilot.ardupilot.dialect import PLANE_DIALECT
from faao_mav.autopilot.ardupilot.failsafes import PLANE_FAILSAFES
from faao_mav.autopilot.ardupilot.plane.flight_model import ArduPlane as ArduPlane
from faao_mav.autopilot.ardupilot.plane.flight_model import ArduPlaneLegs
from faao_mav.autopilot.ardupilot.plane.parameters import TABLE, ArduPlaneLimits
from faao_mav.autopilot.body import ARDUPLANE_BODY
from faao_mav.autopilot.flight_path import FlightModel, VerticalProfile
from faao_mav.autopilot.manners import Modes
from faao_mav.autopilot.orbit import plane_orbit
from faao_mav.autopilot.parameter import ParameterValues
from faao_mav.autopilot.vehicle_type import Ceiling, SpeedRates, VehicleType, lean_acceleration

_LOITER, _RTL = 12, 11
_MODES = Modes(2, 10, _LOITER, {"return": _RTL}, not_to_arm_in=frozenset({_RTL}))
"""PLANE_MODE of MAVLink; ArduPlane 4.7 does not arm in RTL."""


def _vertical(vehicle: ParameterValues) -> VerticalProfile:
    """A return flies home at RTL_ALTITUDE and circles there (ArduPlane's RTL; RTL_AUTOLAND 0)."""
    climb, height = vehicle.value("climb_speed"), vehicle.value("return_height")
    return VerticalProfile(
        take_off_speed=climb,
        climb_speed=climb,
        descent_speed=vehicle.value("descent_speed"),
        acceleration=1.0,
        landing_speed=0.5,
        landing_height=10.0,
        return_height=height,
        spool=3.5,
        keeps_height=height < 0,
        lands_on_return=False,
    )


def _model(vehicle: ParameterValues, latitude: float | None) -> FlightModel:  # noqa: ARG001
    return ArduPlane.from_vehicle(vehicle)


def _true_over_commanded(vehicle: ParameterValues, altitude: float) -> float:
    return ArduPlaneLimits.from_vehicle(vehicle).true_over_commanded(altitude)


def _ceilings(vehicle: ParameterValues) -> tuple[Ceiling, ...]:
    """A turn accelerates by what the bank gives; airspeeds have limits of their own."""
    bank = lean_acceleration(vehicle.value("roll_limit"))
    return (Ceiling("max_acceleration", bank, "roll_limit"),)


def _speed_rates(vehicle: ParameterValues) -> SpeedRates:
    return ArduPlaneLimits.from_vehicle(vehicle).speed_rates


ARDUPLANE = VehicleType(
    family=ARDUPILOT,
    kind="plane",
    name="ArduPlane",
    mav_types=(1,),
    modes=_MODES,
    hovers=False,
    parameters=TABLE,
    dialect=PLANE_DIALECT,
    vertical=_vertical,
    fence_needs_one_inclusion=needs_one_inclusion,
    home_outside_fence=HOME_OUTSIDE_FENCE,
    at_fence=at_fence({0: "report"}),
    failsafes=PLANE_FAILSAFES,
    legs=ArduPlaneLegs.from_vehicle,
    flight_model=_model,
    ceilings=_ceilings,
    body=ARDUPLANE_BODY,
    models_wind=True,
    true_over_commanded=_true_over_commanded,
    speed_rates=_speed_rates,
    orbits=plane_orbit,
    rally=rally_rule,
)
"""ArduPlane 4.7. How it turns and how fast it may fly is tuned on each aircraft: no parameters are
recommended."""
