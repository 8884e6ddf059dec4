"""The airframe, apart from the autopilot that flies it: `vehicle.body`.

The numbers here are fitted to flights of the autopilots' simulators (tests/data/flights): they are
those of the simulated aircraft, yours has others. Limits are chosen.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from pydantic import ConfigDict, Field

from faao_mav.power import GRAVITY

_READ = ConfigDict(extra="forbid", allow_inf_nan=False)


def _key(description: str, unit: str = "", **limits: Any) -> Any:
    """Declare a key of `vehicle.body`: what it means, its unit, pydantic's limits."""
    extra: dict[str, Any] = {"unit": unit, "accepted": ""}
    return Field(description=description, json_schema_extra=extra, strict=True, **limits)


@dataclass(frozen=True, slots=True, kw_only=True)
class CopterBody:
    """A copter's airframe: by default the quadrotor of ArduPilot's simulator."""

    __pydantic_config__ = _READ

    lag: Annotated[
        float, _key("Copter: time constant of the thrust's lag; PX4: 0.26.", "s", ge=0.05, le=1)
    ] = 0.17
    linear_drag: Annotated[
        float, _key("Copter: drag over mass and airspeed; PX4: 0.2.", "1/s", ge=0, le=5)
    ] = 0.28
    quadratic_drag: Annotated[
        float, _key("Copter: drag over mass and airspeed squared; PX4: 0.", "1/m", ge=0, le=1)
    ] = 0.0261

    def top_airspeed(self, lean_angle: float) -> float:
        """Return the airspeed, m/s, at which the drag takes all that `lean_angle`, rad, gives.

        It is the root v of k v + q v² = g tan(lean).

        >>> round(CopterBody().top_airspeed(math.radians(30)), 1)
        10.3
        """
        lean, k = GRAVITY * math.tan(lean_angle), self.linear_drag
        rooted = k + math.sqrt(k**2 + 4 * self.quadratic_drag * lean)
        return 2 * lean / rooted if rooted > 0 else math.inf


ARDUCOPTER_BODY = CopterBody()
"""The quadrotor of ArduPilot's simulator."""

PX4_BODY = CopterBody(lag=0.26, linear_drag=0.2, quadratic_drag=0.0)
"""The quadrotor of PX4's simulator: its drag is SIH_KDV over SIH_MASS of the recorded flights, of
which a fit finds 0.19."""


def density_ratio(altitude: float) -> float:
    """Return the air's density over sea level's, (1 - 2.25577e-5 h)^4.25588 (ISO 2533).

    h, m, is the `altitude` above sea level, up to the tropopause. True over equivalent airspeed is
    the root of its inverse.

    >>> round(density_ratio(684.0) ** -0.5, 4)
    1.0336
    """
    return math.pow(1 - 2.25577e-5 * min(altitude, 11_000.0), 4.25588)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneBody:
    """A plane's airframe: by default that of ArduPilot's simulator.

    A log of 12 m/s showed `sideslip_airspeed`: less sideslip, and tighter turns. Up to July 2026
    the simulator's airspeed sensor takes the density out twice (ArduPilot's issue 31004), and it
    flies 3 % faster for it at 584 m.
    """

    __pydantic_config__ = _READ

    airspeed_lag: Annotated[
        float,
        _key("Plane: time constant from the airspeed told to that flown.", "s", ge=0.05, le=10),
    ] = 1.5
    sideslip: Annotated[
        float, _key("Plane: share of a turn's acceleration that sideslip takes.", ge=0, le=0.9)
    ] = 0.286
    sideslip_airspeed: Annotated[
        float, _key("Plane: airspeed below which `sideslip` falls.", "m/s", gt=0, le=1000)
    ] = 13.0
    airspeed_exponent: Annotated[
        float,
        _key(
            "Plane: power of the air's density, over sea level's, by which the airspeed reads low; "
            "0.5 is right, the simulator up to July 2026: 1.",
            ge=0,
            le=2,
        ),
    ] = 0.5


ARDUPLANE_BODY = PlaneBody()
"""The plane of ArduPilot's simulator."""

Body: TypeAlias = CopterBody | PlaneBody
"""The airframe of one family."""
