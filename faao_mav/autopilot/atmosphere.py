"""The international standard atmosphere, as far as an aircraft's airspeed needs it."""

import math

_LAPSE = 2.25577e-5  # temperature lapse over the temperature at sea level, 1/m
_EXPONENT = 4.25588  # of the temperature's ratio in that of the density
_TROPOPAUSE = 11_000.0  # m


def density_ratio(altitude: float) -> float:
    """Return rho / rho_0 = (1 - 2.25577e-5 h)^4.25588 (ISO 2533).

    h, m, is the `altitude` above sea level.
    True over equivalent airspeed is the root of its inverse. Altitudes above the tropopause, 11 km,
    count as 11 km, those below sea level as they are.

    >>> round(density_ratio(684.0) ** -0.5, 4)
    1.0336
    """
    return math.pow(1 - _LAPSE * min(altitude, _TROPOPAUSE), _EXPONENT)
