"""Up to which wind a mission keeps what it promises, from wherever the wind comes."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import FaaoError
from faao_mav.mission.command import Command
from faao_mav.mission.item import Mission
from faao_mav.plan import Vector, Wind
from faao_mav.vector import lengths
from faao_mav.vehicle import Track, Vehicle
from faao_mav.vehicle.vehicle_type import HELD

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
_STEP = 0.25
"""The step of the limit, m/s. Chosen."""

_STEPS = round(MOST_WIND / _STEP)

_INSTANTS = 300
"""The most instants of a flight at which its lateness in wind is foreseen. Chosen."""

_SLOWEST = 0.1
"""The least ground speed, m/s, that is foreseen: an aircraft that the wind holds is late anyway."""


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
    sought by predicted flights: first in the direction where the least wind makes the flight late
    by its airspeeds, then in those where less than the limit found so far is kept.
    """
    top, hovers = vehicle.type.max_airspeed(vehicle), vehicle.type.hovers
    known = math.isfinite(top) if hovers else vehicle.type.models_wind
    if not known or track.t[-1] > _LONGEST:
        return None
    beside = (0.0, 0.0) if hovers or solution is None else solution.plan.wind
    flown = mission if solution is None else _without_return(mission)
    trial = _Trial(flown, vehicle, float(track.t[-1]), solution, lead, beside)
    relayed = (track.t, track.velocity[:, :2])
    if solution is not None:
        relayed = (solution.t, np.gradient(solution.w, solution.t, axis=0))
    fastest = top / HELD if hovers else None
    degrees = [360.0 / _DIRECTIONS * k for k in range(_DIRECTIONS)]
    foreseen = sorted((_foreseen(*relayed, fastest, beside, each), each) for each in degrees)
    steps, worst = _STEPS, foreseen[0][1]
    if not trial.fulfilled(track):
        return WindLimit(0.0, worst, beside)
    for guess, start in foreseen:
        least = _harmless(track, top, start) if hovers else 0.0
        kept = min(math.floor(least / _STEP + 1e-9), steps)
        if kept < steps and vehicle.type.models_wind:
            kept = trial.strongest(kept, steps, guess if steps == _STEPS else steps, start)
        if kept < steps:
            steps, worst = kept, start
    return WindLimit(_STEP * steps, worst, beside)


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


def _foreseen(t: Real, v: Real, top: float | None, beside: Vector, degrees: float) -> int:
    """Return the strongest wind from `degrees`, in steps, in which airspeeds make no flight late.

    The flight has the ground speeds `v` (n, 2), m/s, at `t` (n,), s, in a wind `beside`. Along the
    same way it is as fast in another wind W as an airspeed a, `top` or without it the flight's own,
    leaves along its direction u,

        g = u·W + sqrt(a² - |W|² + (u·W)²),

    and what hovers no faster than before.
    """
    stride = max(1, len(t) // _INSTANTS)
    lasting = np.diff(t[::stride], append=t[-1])
    v = v[::stride]
    speed = np.maximum(lengths(v), _SLOWEST)
    own = lengths(v - beside) if top is None else top
    wind = beside + _STEP * np.arange(_STEPS + 1)[:, None] * Wind(1.0, degrees).velocity
    along = wind @ (v / speed[:, None]).T
    across = (wind * wind).sum(axis=1)[:, None] - along * along
    left = np.maximum(along + np.sqrt(np.maximum(own**2 - across, 0.0)), _SLOWEST)
    if top is not None:
        left = np.minimum(left, speed)
    late = np.abs((speed / left - 1) @ lasting) > MOST_LATE
    return int(np.argmax(np.append(late, True))) - 1


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

    def strongest(self, low: int, high: int, guess: int, degrees: float) -> int:
        """Return the strongest wind from `degrees` that is kept, in steps from `low` to `high`.

        `low` is kept. From the `guess` on winds are tried, farther and farther, up to one that is
        kept and one that is not.
        """
        step, found = 1, set()
        while low < high:
            tried = min(max(guess, low + 1), high)
            kept = self.keeps(_STEP * tried, degrees)
            found.add(kept)
            low, high = (tried, high) if kept else (low, tried - 1)
            guess = tried + step if kept else tried - step
            step *= 2
            if len(found) == 2:
                guess = (low + high + 1) // 2
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
