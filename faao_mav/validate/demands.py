"""What a flight is asked to keep: limits that are given, and the plan that it is to carry out."""

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


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of the flight, from `start` to `end` s of the plan, that loses `rate_lost`.

    `rate_lost` is what the average over the whole flight loses there, bit/s/Hz.
    """

    start: float
    end: float
    rate_lost: float


@dataclass(frozen=True, slots=True)
class LinkCheck:
    """A plan and how the mission is predicted to carry it out.

    Rates in bit/s/Hz, averaged over the flight; durations in s; `rms_position_error` and
    `max_position_error` m between planned and predicted position at equal times; `path_error` m
    between planned and predicted path, `path_tolerance` m what the plan allows of it;
    `altitude_error` m between planned and predicted height; `worst` the stretch that loses most,
    None if none does.
    """

    planned_rate: float
    predicted_rate: float
    planned_duration: float
    predicted_duration: float
    rms_position_error: float
    max_position_error: float
    path_error: float
    path_tolerance: float
    altitude_error: float = 0.0
    worst: Stretch | None = None

    @property
    def share(self) -> float:
        """The part of the planned rate that is predicted to be delivered."""
        return self.predicted_rate / self.planned_rate if self.planned_rate > 0 else 1.0
