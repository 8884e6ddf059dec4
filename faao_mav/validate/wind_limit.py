"""Up to which wind a mission keeps what it promises, from wherever the wind comes."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from faao_mav.errors import FaaoError
from faao_mav.mission.command import Command
from faao_mav.mission.item import Mission
from faao_mav.plan import Vector, Wind
from faao_mav.vector import lengths
from faao_mav.vehicle import Track, Vehicle

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Solution

LEAST_RATE, MOST_LATE = 0.95, 5.0
"""The share of the planned rate, and the seconds that the end may be early or late, which a mission
keeps up to its wind limit. Chosen."""

MOST_WIND = 20.0
"""The strongest wind that is looked at, m/s: 8 on Beaufort's scale. Chosen."""

_LONGEST = 3600.0
"""The longest flight, s, whose limit is sought. Chosen: a dozen predictions of it take seconds."""

_SLOWER = 3.0
"""How many times as long a flight in wind may take as without before it is given up. Chosen: the
relay's part has to be in time, the ways from home and back need not."""

_DIRECTIONS = 8
_STEP, _FIRST_STEP = 0.25, 1.0
"""The step of the limit, and the first one beyond a wind that is surely kept, m/s. Chosen."""


@dataclass(frozen=True, slots=True)
class WindLimit:
    """The strongest steady wind, m/s, that a mission keeps from the worst of eight directions.

    It keeps 95 % of the planned rate, and its end within 5 s; without a plan its end alone.
    `from_degrees` is where the worst wind comes from; `speed` is at most 20 m/s. An aeroplane holds
    its airspeed, so that what counts is the change from the wind that its mission is timed for:
    `beside`, east and north, m/s; of what hovers it is zero.
    """

    speed: float
    from_degrees: float
    beside: Vector = (0.0, 0.0)


def wind_limit(
    mission: Mission,
    vehicle: Vehicle,
    track: Track,
    *,
    solution: "Solution | None" = None,
    lead: float | None = None,
) -> WindLimit | None:
    """Return the wind limit of `mission`.

    None for a vehicle of which it is not known what a wind does to it, and for flights of more than
    an hour. `track` is its predicted flight in the air that it is made for, `solution` the plan
    that it carries out: without one only the time counts, beside that of `track`. `lead` is as in
    `check.check`.

    Within the airspeed of a vehicle that hovers a wind changes nothing; an aeroplane's flight is
    changed by any. From the strongest wind in which all of `track` is within that, the limit is
    sought upwards by predicted flights: in the direction where that wind is weakest, then in those
    where less than the limit found so far is kept.
    """
    top, hovers = vehicle.type.max_airspeed(vehicle), vehicle.type.hovers
    known = math.isfinite(top) if hovers else vehicle.type.models_wind
    if not known or track.t[-1] > _LONGEST:
        return None
    beside = (0.0, 0.0) if hovers or solution is None else solution.plan.wind
    flown = mission if solution is None else _without_return(mission)
    trial = _Trial(flown, vehicle, float(track.t[-1]), solution, lead, beside)
    degrees = [360.0 / _DIRECTIONS * k for k in range(_DIRECTIONS)]
    harmless = sorted((_harmless(track, top, each) if hovers else 0.0, each) for each in degrees)
    found = WindLimit(MOST_WIND, harmless[0][1], beside)
    if not trial.fulfilled(track):
        return replace(found, speed=0.0)
    for least, start in harmless:
        kept = min(least, found.speed)
        if kept < found.speed and vehicle.type.models_wind:
            kept = trial.strongest(kept, found.speed, start)
        if kept < found.speed:
            found = WindLimit(kept, start, beside)
    return replace(found, speed=_STEP * math.floor(found.speed / _STEP + 1e-9))


def _without_return(mission: Mission) -> Mission:
    """Return `mission` without the return at its end, in which no plan is carried out."""
    items = mission.items
    returns = bool(items) and items[-1].command == Command.NAV_RETURN_TO_LAUNCH
    return replace(mission, items=items[:-1]) if returns else mission


def _harmless(track: Track, top: float, degrees: float) -> float:
    """Return the strongest wind from `degrees`, m/s, that takes no airspeed of `track` above `top`.

    0 where calm air does already.
    """
    v = track.velocity[:, :2]
    toward = np.array(Wind(1.0, degrees).velocity)
    along = v @ toward
    room = top**2 - (lengths(v) ** 2 - along**2)
    strongest = along + np.sqrt(np.maximum(room, 0.0))
    return float(max(0.0, np.where(room > 0, strongest, 0.0).min()))


@dataclass(frozen=True, slots=True)
class _Trial:
    """A mission that is predicted in one wind after the other; `duration`, s, is what it takes.

    Winds add to that `beside`, m/s.
    """

    mission: Mission
    vehicle: Vehicle
    duration: float
    solution: "Solution | None"
    lead: float | None
    beside: Vector

    def strongest(self, low: float, high: float, degrees: float) -> float:
        """Return the strongest wind from `degrees` that is kept, between `low` and `high` m/s.

        `low` is kept. Unless it is the strongest of all, `high` is what other directions keep.
        """
        if high < MOST_WIND and self.keeps(high, degrees):
            return high
        step = _FIRST_STEP
        while high == MOST_WIND and low < high:
            if self.keeps(min(low + step, high), degrees):
                low, step = min(low + step, high), 2 * step
            else:
                high = min(low + step, high)
                break
        while high - low > _STEP:
            middle = (low + high) / 2
            low, high = (middle, high) if self.keeps(middle, degrees) else (low, middle)
        return low

    def keeps(self, speed: float, degrees: float) -> bool:
        """Tell whether the mission keeps rate and time in a wind of `speed`, m/s."""
        from faao_mav.vehicle.predict import predict

        east, north = Wind(speed, degrees).velocity
        try:
            track = predict(
                self.mission,
                self.vehicle,
                wind=(self.beside[0] + east, self.beside[1] + north),
                longest=_SLOWER * self.duration,
            )
        except FaaoError:
            return False
        return self.fulfilled(track)

    def fulfilled(self, track: Track) -> bool:
        """Tell whether the flight `track` is in time, and then whether it has the rate."""
        from faao_mav.validate.comparison import keeps_plan

        if self.solution is None:
            return abs(float(track.t[-1]) - self.duration) <= MOST_LATE
        return keeps_plan(self.solution, track, self.lead, share=LEAST_RATE, late=MOST_LATE)
