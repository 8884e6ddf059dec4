"""Where a vehicle was, as telemetry or a log tells it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from faao_mav.arrays import Real
from faao_mav.autopilot import Track
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.solution import Solution
from faao_mav.validate.comparison import on_the_plans_clock
from faao_mav.validate.flown import Debriefing, Line, debriefing, plan_start, planned_line


class Fix(NamedTuple):
    """A position: s on the vehicle's clock, degrees, m above the sea, and m/s of wind."""

    t: float
    latitude: float
    longitude: float
    altitude: float
    home: float
    east: float = math.nan
    north: float = math.nan


def predicted_line(solution: Solution, track: Track | None) -> Line:
    """Return the predicted flight `track` on the plan's clock; the plan itself without one."""
    return planned_line(solution) if track is None else Line(*on_the_plans_clock(solution, track))


@dataclass(frozen=True, slots=True, eq=False)
class FlightRecord:
    """A vehicle's own estimate of where it was.

    `t` (k,), s, is the vehicle's clock, which increases; `latitude` and `longitude` (k,) are
    degrees; `altitude` and `home` (k,) are how high it and its home were above the sea, m: home may
    be set again. `wind` (k, 2) is the wind as it was estimated, m/s towards east and north, NaN
    where that is not known. `parameters` are those that a log names. `system` is the number by
    which it told that over MAVLink.
    """

    t: Real
    latitude: Real
    longitude: Real
    altitude: Real
    home: Real
    wind: Real
    parameters: Mapping[str, float] = field(default_factory=dict)
    system: int | None = None

    @classmethod
    def of(
        cls, fixes: ArrayLike, parameters: Mapping[str, float] | None = None, system: int = 0
    ) -> "FlightRecord":
        """Return the record of positions, each a `Fix`."""
        t, latitude, longitude, altitude, home, *wind = np.reshape(fixes, (-1, len(Fix._fields))).T
        place = latitude, longitude, altitude, home
        return cls(t, *place, np.stack(wind, axis=1), parameters or {}, system or None)

    @property
    def height(self) -> Real:
        """How high it was above home, (k,), m."""
        return self.altitude - self.home

    def height_above_home_at(self, time: float) -> Real:
        """Return the heights (k,), m, above home as it was at `time`, s."""
        last = max(0, int(np.searchsorted(self.t, time, "right")) - 1)
        return np.asarray(self.altitude - self.home[last])

    def mean_wind(self, start: float, duration: float) -> Real | None:
        """Return the mean (2,) of the wind in that time, None where nothing was estimated."""
        during = (self.t >= start) & (self.t <= start + duration)
        values = self.wind[during & np.isfinite(self.wind).all(axis=1)]
        return np.asarray(values.mean(axis=0)) if len(values) else None

    def line(self, solution: Solution) -> Line:
        """Return it in the local metres of the solution's plan."""
        origin = solution.plan.origin
        frame = LocalFrame(origin.latitude, origin.longitude)
        return Line(self.t, np.asarray(frame.to_local(self.latitude, self.longitude)))

    def debriefing(
        self, solution: Solution, predicted: Line, start: float | None = None
    ) -> Debriefing | None:
        """Return what became of the plan; None: it is not in there.

        `start` is when the plan's clock read 0, s on the vehicle's; None: that is searched.
        """
        flight = self.line(solution)
        start = plan_start(solution, predicted, flight) if start is None else start
        if start is None:
            return None
        height = self.height_above_home_at(start)
        return debriefing(solution, predicted, flight, height, start)
