"""Where a vehicle stands beside what its mission counts from."""

import math
from dataclasses import dataclass

from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import LatLon
from faao_mav.mission.item import Home, Mission
from faao_mav.wire.messages import GlobalPositionInt, HomePosition

HOME_AWAY = 20.0
"""The farthest that a vehicle may stand from its mission's home, m. Chosen: several times the error
of satellite navigation and of a click on a map (3 to 10 m), and small beside fences' margins."""

HOME_HIGHER = 10.0
"""The most by which it may stand higher or lower, m: the mission's heights count from where the
vehicle stands. Chosen: what the heights of satellite navigation and of terrain maps differ by in 19
of 20 places."""

FIRST_AWAY, FIRST_FARTHEST = 500.0, 10_000.0
"""The farthest that the mission's first place may be from where it stands, m: where no home tells
how far it is meant to be, and in any case. Chosen: how far an aircraft is kept in sight; and PX4's
default of MIS_DIST_1WP."""


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """Where a vehicle stands.

    `from_home` and `from_first` are metres to its mission's home and first place, `higher` metres
    above that home, below zero: lower. None: the mission does not tell.
    """

    from_home: float | None
    higher: float | None
    from_first: float | None

    @classmethod
    def of(cls, place: Home, mission: Mission) -> "Whereabouts":
        """Return where a vehicle at `place` stands beside `mission`."""
        home, first = mission.home, mission.first_place
        from_first = None if first is None else distance(place, first)
        if home is None:
            return cls(None, None, from_first)
        from_home = distance(place, (home.latitude, home.longitude))
        known = math.isfinite(home.altitude)
        return cls(from_home, place.altitude - home.altitude if known else None, from_first)

    @property
    def is_meant(self) -> bool:
        """Whether it stands where the mission was made for, as far as the mission tells."""
        if self.from_home is not None:
            return self.from_home <= HOME_AWAY and abs(self.higher or 0.0) <= HOME_HIGHER
        return self.from_first is None or self.from_first <= FIRST_AWAY

    @property
    def height_shown(self) -> str:
        """By how much it stands higher or lower, for people."""
        if self.higher is None:
            return "how much higher is not known"
        return f"{abs(self.higher):.0f} m {'lower' if self.higher < 0 else 'higher'}"

    def __str__(self) -> str:
        if self.from_home is not None:
            return f"{shown(self.from_home)} from the mission's home, {self.height_shown}"
        if self.from_first is not None:
            return f"{shown(self.from_first)} from the mission's first place; it tells no home"
        return "the mission tells no place"


def distance(place: Home, other: LatLon) -> float:
    """Return how far it is from `place` to `other`, m; infinity at the antipode."""
    east, north = LocalFrame(place.latitude, place.longitude).to_local(*other).tolist()
    away = math.hypot(east, north)
    return away if math.isfinite(away) else math.inf


def shown(metres: float) -> str:
    """Return a distance for people.

    >>> shown(12.3), shown(1_932.0), shown(15_432_100.0)
    ('12 m', '1932 m', '15432 km')
    """
    return f"{metres:.0f} m" if metres < FIRST_FARTHEST else f"{metres / 1000:.0f} km"


def home_in(message: HomePosition) -> Home:
    """Return the home that `message` tells; raises `InputError` for one that is not on Earth."""
    return Home(message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1000)


def place_in(message: GlobalPositionInt) -> Home | None:
    """Return the place that `message` tells, metres above mean sea level; None: it tells none.

    ArduPilot tells 0, 0 as long as it does not know where it is.
    """
    try:
        place = Home(message.lat / 1e7, message.lon / 1e7, message.alt / 1000)
    except InputError:
        return None
    return place if message.lat or message.lon else None
