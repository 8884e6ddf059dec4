"""Where a vehicle was, as telemetry or a log tells it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.solution import Solution
from faao_mav.validate.flown import Debriefing, Line, debriefing, plan_start


@dataclass(frozen=True, slots=True, eq=False)
class FlightRecord:
    """A vehicle's own estimate of where it was.

    `t` (k,), s, is the vehicle's clock, which increases; `latitude` and `longitude` (k,) are
    degrees, `height` (k,) metres above home. `wind` (m, 3) is the wind as it was estimated: times,
    s, and m/s towards east and north, None where that is not known. `parameters` are those that the
    log names. `home` (k,) is the altitude of home, m, which may be set again, None where it stayed.
    `system` is the number by which it told that over MAVLink.
    """

    t: Real
    latitude: Real
    longitude: Real
    height: Real
    wind: Real | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    home: Real | None = None
    system: int | None = None

    def mean_wind(self, start: float, duration: float) -> Real | None:
        """Return the mean (2,) of the wind in that time, None where nothing was estimated.

        ArduCopter that is not told how its air drag is estimates none, and logs zeros.
        """
        if self.wind is None:
            return None
        t, values = self.wind[:, 0], self.wind[:, 1:]
        values = values[(t >= start) & (t <= start + duration)]
        return np.asarray(values.mean(axis=0)) if values.any() else None

    def line(self, solution: Solution) -> Line:
        """Return it in the local metres of the solution's plan."""
        origin = solution.plan.origin
        frame = LocalFrame(origin.latitude, origin.longitude)
        return Line(self.t, np.asarray(frame.to_local(self.latitude, self.longitude)))

    def height_above_home_at(self, time: float) -> Real:
        """Return the heights (k,), m, above home as it was at `time`, s."""
        if self.home is None:
            return self.height
        last = max(0, int(np.searchsorted(self.t, time, "right")) - 1)
        return np.asarray(self.height + (self.home - self.home[last]))

    def debriefing(
        self, solution: Solution, predicted: Line, start: float | None = None
    ) -> Debriefing | None:
        """Return what became of the plan; None: it is not in there.

        `start` is when the plan's clock read 0, s on the vehicle's; None: that is searched.
        """
        flight = self.line(solution)
        if start is None:
            start = plan_start(solution, predicted, flight)
        if start is None:
            return None
        height = self.height_above_home_at(start)
        return debriefing(solution, predicted, flight, height, start)
