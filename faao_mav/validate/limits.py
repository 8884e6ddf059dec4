"""What the person who flies sets as limits."""

import math
from dataclasses import dataclass

from faao_mav.errors import InputError


@dataclass(frozen=True, slots=True)
class Limits:
    """What a flight must stay within; None: no limit.

    `max_duration`, s, of the whole flight; `max_distance`, m, from home over ground;
    `max_altitude`, m above home; `max_speed`, m/s, over ground; `max_acceleration`, m/s², over
    ground. Raises `InputError` for one that is not a finite number above 0.
    """

    max_duration: float | None = None
    max_distance: float | None = None
    max_altitude: float | None = None
    max_speed: float | None = None
    max_acceleration: float | None = None

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise InputError(f"{name}: {value}; expected a number above 0")
