"""ArduPlane: what it is, and how it flies a mission."""

from faao_mav.autopilot.ardupilot import SHARED, ardupilot_type, at_fence
from faao_mav.autopilot.ardupilot.dialect import PLANE_DIALECT
from faao_mav.autopilot.ardupilot.plane.flight_model import ArduPlane as ArduPlane
from faao_mav.autopilot.body import ARDUPLANE_BODY
from faao_mav.autopilot.failsafe import failsafes
from faao_mav.autopilot.manners import Modes
from faao_mav.autopilot.orbit import plane_orbit
from faao_mav.autopilot.parameter import Parameter, row, rule, table

_LOITER, _RTL = 12, 11
_MODES = Modes(2, 10, _LOITER, {"return": _RTL}, not_to_arm_in=frozenset({_RTL}))
"""PLANE_MODE of MAVLink; ArduPlane 4.7 does not arm in RTL."""


_TABLE = table(
    *ArduPlane.parameters(),
    row("loiter_radius", "m", 60.0, "WP_LOITER_RAD", least=1, either_sign=True),
    row("return_height", "m", 100.0, "RTL_ALTITUDE", "ALT_HOLD_RTL", least=-1, motion=False),
    *SHARED,
    rule("fence_options", 1, "FENCE_OPTIONS"),
    rule("fence_type", 4, "FENCE_TYPE"),
    rule("return_lands", 0, "RTL_AUTOLAND"),
    Parameter("rally_limit", "m", 5000.0, {"RALLY_LIMIT_KM": 1000.0}, motion=False),
    rule("rally_home", 0, "RALLY_INCL_HOME"),
)
"""ArduPlane's parameters. A negative `loiter_radius` turns left; a `return_height` below 0 keeps
the height at which the return begins."""

ARDUPLANE = ardupilot_type(
    kind="plane",
    name="ArduPlane",
    mav_types=(1,),
    modes=_MODES,
    hovers=False,
    parameters=_TABLE,
    dialect=PLANE_DIALECT,
    returns_at_least=False,
    at_fence=at_fence({0: "report"}),
    failsafes=failsafes("arduplane"),
    flight_model=ArduPlane.from_vehicle,
    ceilings={"max_acceleration": ("roll_limit",)},
    body=ARDUPLANE_BODY,
    orbits=plane_orbit,
)
"""ArduPlane 4.7. How it turns and how fast it may fly is tuned on each aircraft: no parameters are
recommended."""
