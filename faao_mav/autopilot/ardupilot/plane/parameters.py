"""ArduPlane's parameters: the newer names first, the older ones second.

Source: ArduPilot 4.7, parameter list of Plane.
"""

import math
from dataclasses import dataclass
from math import pi, radians

from faao_mav.autopilot.ardupilot import SHARED, rally_parameters, switch
from faao_mav.autopilot.atmosphere import density_ratio
from faao_mav.autopilot.body import ARDUPLANE_BODY, PlaneBody
from faao_mav.autopilot.model import Model, SpeedRates, parameter
from faao_mav.autopilot.parameter import Parameter, table
from faao_mav.power import GRAVITY

_TURN = 1.2
"""The least radius of a turn over the guidance's look-ahead, both in seconds of flight.

Of random plans whose turns had 1.05 at their airspeed, so less over ground against the wind, two
were flown 17 and 38 m rms from them; planned with 1.2 over ground these were 5.5 and 6.6 m off.
"""


@dataclass(frozen=True, slots=True)
class ArduPlaneLimits(Model):
    """What bounds a flight of ArduPlane, in SI units.

    `descent_speed` is the sink rate with an idling engine; `body` is the aircraft.
    """

    cruise_speed: float = parameter(
        "m/s", 12.0, {"AIRSPEED_CRUISE": 1.0, "TRIM_ARSPD_CM": 0.01}, 1.0
    )
    min_speed: float = parameter("m/s", 9.0, {"AIRSPEED_MIN": 1.0, "ARSPD_FBW_MIN": 1.0}, 1.0)
    max_speed: float = parameter("m/s", 22.0, {"AIRSPEED_MAX": 1.0, "ARSPD_FBW_MAX": 1.0}, 1.0)
    roll_limit: float = parameter(
        "rad",
        radians(45),
        {"ROLL_LIMIT_DEG": radians(1), "LIM_ROLL_CD": radians(0.01)},
        radians(5),
        radians(85),
    )
    roll_time: float = parameter("s", 0.5, {"RLL2SRV_TCONST": 1.0}, 0.05)
    waypoint_radius: float = parameter("m", 90.0, {"WP_RADIUS": 1.0}, 1.0)
    climb_speed: float = parameter("m/s", 5.0, {"TECS_CLMB_MAX": 1.0}, 0.1)
    descent_speed: float = parameter("m/s", 2.0, {"TECS_SINK_MIN": 1.0}, 0.1)
    period: float = parameter("s", 17.0, {"NAVL1_PERIOD": 1.0}, 1.0)
    damping: float = parameter("", 0.75, {"NAVL1_DAMPING": 1.0}, 0.1)
    body: PlaneBody = ARDUPLANE_BODY

    @property
    def look_ahead(self) -> float:
        """How far ahead the guidance aims, s: ζ T / π."""
        return self.damping * self.period / pi

    def true_airspeed(self, commanded: float, altitude: float) -> float:
        """Return the true airspeed, m/s, at which a `commanded` one is flown.

        The equivalent airspeed is within `min_speed` and `max_speed`; 0 or less is `cruise_speed`.
        `altitude` is m above sea level.
        """
        wanted = commanded if commanded > 0 else self.cruise_speed
        held = min(max(wanted, self.min_speed), self.max_speed)
        return held * self.true_over_commanded(altitude)

    def true_over_commanded(self, altitude: float) -> float:
        """Return true over commanded airspeed at `altitude`, m above sea level."""
        return math.pow(density_ratio(altitude), -self.body.airspeed_exponent)

    @property
    def speed_rates(self) -> SpeedRates:
        """How fast the demanded true airspeed changes at most.

        At a true airspeed V, m/s, total energy control lets it fall by 0.9 g s / V_c and rise by
        0.5 g c / V, with the `descent_speed` s, the `cruise_speed` V_c and the `climb_speed` c (as
        its logs show; in falls from above V_c it counts TECS_SINK_MAX too, which is left out). A
        turn takes `_TURN` times the look-ahead or longer for a radian.
        """
        fall = 0.9 * GRAVITY * self.descent_speed / self.cruise_speed
        turn = 1 / (_TURN * self.look_ahead)
        return SpeedRates(fall, 0.5 * GRAVITY * self.climb_speed, turn)


TABLE = table(
    *ArduPlaneLimits.parameters(),
    Parameter("loiter_radius", "m", 60.0, {"WP_LOITER_RAD": 1.0}, 1.0, either_sign=True),
    Parameter(
        "return_height", "m", 100.0, {"RTL_ALTITUDE": 1.0, "ALT_HOLD_RTL": 0.01}, -1.0, motion=False
    ),
    *SHARED,
    switch("fence_options", 1, "FENCE_OPTIONS"),
    switch("fence_type", 4, "FENCE_TYPE"),
    switch("return_lands", 0, "RTL_AUTOLAND"),
    *rally_parameters(limit=5000.0, home=0),
)
"""ArduPlane's parameters. A negative `loiter_radius` turns left; a `return_height` below 0 keeps
the height at which the return begins."""
