"""A flight beside the plan that it carries out: predicted, while it lasts, and when it is over."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from faao_mav.arrays import Real
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.prediction import Prediction, positions_at, price_flight
from faao_mav.schedule.route import set_out
from faao_mav.schedule.timing import MOST_LEAD
from faao_mav.validate.rule import threshold
from faao_mav.vector import distances_to_path, lengths


class Line(NamedTuple):
    """A flight in the plan's frame: at `t` (k,), s, at `w` (k, 2), m, `up` (k,) m above home.

    Times count on the plan's clock, or on the vehicle's until it is known where they meet.
    """

    t: Real
    w: Real
    up: Real

    @classmethod
    def planned(cls, solution: Solution) -> "Line":
        """Return the plan itself."""
        return cls(solution.t, solution.w, np.full(len(solution.t), solution.plan.flight.altitude))

    def at(self, times: Real) -> Real:
        """Return where it is at `times` (n,), s: (n, 2), m."""
        return positions_at(times, self.t, self.w)

    def priced(self, solution: Solution) -> Prediction:
        """Return what the channel of `solution` delivers along it."""
        return price_flight(solution, self.t, self.w)

    def altitude_error(self, solution: Solution) -> float:
        """Return the greatest distance, m, from the planned height."""
        during = np.interp(solution.t, self.t, self.up)
        return float(np.abs(during - solution.plan.flight.altitude).max())


class Fix(NamedTuple):
    """A position: s on the vehicle's clock, degrees, m above the sea, and m/s of wind.

    `rssi` is what its telemetry radio counted there, NaN where it did not.
    """

    t: float
    latitude: float
    longitude: float
    altitude: float
    home: float
    east: float = math.nan
    north: float = math.nan
    rssi: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class FlightRecord:
    """Where a vehicle was, by its own estimate, as telemetry or a log tells it.

    `t` (k,), s, is the vehicle's clock, which increases; `latitude` and `longitude` (k,) are
    degrees; `altitude` and `home` (k,) are how high it and its home were above the sea, m: home may
    be set again. `wind` (k, 2) is the wind as it was estimated, m/s towards east and north, NaN
    where that is not known. `rssi` (k,) is the level that its telemetry radio counted, NaN where it
    told none. `parameters` are those that a log names. `system` is the number by which it told that
    over MAVLink.
    """

    t: Real
    latitude: Real
    longitude: Real
    altitude: Real
    home: Real
    wind: Real
    rssi: Real
    parameters: Mapping[str, float] = field(default_factory=dict)
    system: int | None = None

    @classmethod
    def of(
        cls, fixes: ArrayLike, parameters: Mapping[str, float] | None = None, system: int = 0
    ) -> "FlightRecord":
        """Return the record of positions, each a `Fix`."""
        columns = np.reshape(fixes, (-1, len(Fix._fields))).T
        t, latitude, longitude, altitude, home, east, north, rssi = columns
        place = latitude, longitude, altitude, home
        wind = np.stack([east, north], axis=1)
        return cls(t, *place, wind, rssi, parameters or {}, system or None)

    def mean_wind(self, start: float, duration: float) -> Real | None:
        """Return the mean (2,) of the wind in that time, None where nothing was estimated."""
        during = (self.t >= start) & (self.t <= start + duration)
        values = self.wind[during & np.isfinite(self.wind).all(axis=1)]
        return np.asarray(values.mean(axis=0)) if len(values) else None

    def line(self, solution: Solution, start: float = 0.0) -> Line:
        """Return it in the frame of the plan, whose clock reads 0 at `start`, s; as high as then.

        That is: above home as it was at `start`.
        """
        frame = solution.plan.origin.frame
        home = self.home[max(0, int(np.searchsorted(self.t, start, "right")) - 1)]
        w = np.asarray(frame.to_local(self.latitude, self.longitude))
        return Line(self.t - start, w, self.altitude - home)


@dataclass(frozen=True, slots=True)
class Standing:
    """How a flight stands at `time`, s on the plan's clock.

    It is `late` by so many seconds, `apart` metres from where the plan has it now and `astray`
    metres from the planned path. `I_U` and `I_G` are the rates of the present slot, bit/s/Hz.
    `delivered` is what the relay has forwarded in the slots that are over, `expected` that of the
    whole flight if it goes on as predicted and as late as it is: bit/Hz. The relay flight is `over`
    when its time is up and the aircraft has been at w_F.
    """

    time: float
    late: float
    apart: float
    astray: float
    I_U: float
    I_G: float
    delivered: float
    expected: float
    over: bool


@dataclass(frozen=True, slots=True, eq=False)
class Debriefing:
    """What became of a plan: as it was `predicted`, and as it was `flown`.

    The plan's clock reads 0 at `start` s of the flight's. `missing` is for how many seconds of the
    plan there is no flight: the aircraft then counts as staying where it was seen last.
    `altitude_error` is the greatest distance, m, from the planned height. From `around_end` before
    the plan's end on it came to w_F within `from_end` m.
    """

    solution: Solution
    predicted: Prediction
    flown: Prediction
    start: float
    missing: float
    altitude_error: float
    from_end: float

    @property
    def broken_off(self) -> bool:
        """Whether the flight was not flown to its end."""
        return self.missing == 0 and self.from_end > threshold.broken_off

    @property
    def seen(self) -> float:
        """What had been delivered where the flight ends, as a share of the plan's; 1: all of it."""
        slots = round(len(self.solution.t) * (1 - self.missing / float(self.solution.t[-1])))
        planned = self.solution.delivered_rate * len(self.solution.t)
        return float(self.flown.relayed.forwarded[:slots].sum()) / planned if planned else 1.0


def debriefing(
    solution: Solution, predicted: Line, record: FlightRecord, start: float | None = None
) -> Debriefing | None:
    """Return what became of the plan in the flight of `record`; None: it is not in there.

    `start` is when the plan's clock read 0, s on the vehicle's; None: that is searched.
    """
    if start is None:
        start = plan_start(solution, predicted, record.line(solution))
    if start is None:
        return None
    flight = record.line(solution, start)
    ends = min(float(solution.t[-1]) - threshold.around_end, float(flight.t[-1]))
    return Debriefing(
        solution=solution,
        predicted=predicted.priced(solution),
        flown=flight.priced(solution),
        start=start,
        missing=max(0.0, float(solution.t[-1] - flight.t[-1])),
        altitude_error=flight.altitude_error(solution),
        from_end=float(lengths(flight.w[flight.t >= ends] - solution.w[-1]).min()),
    )


def plan_start(solution: Solution, predicted: Line, flight: Line) -> float | None:
    """Return when, s on the clock of `flight`, the plan's clock reads 0; None: not in this flight.

    That is where the departure from w_I is most like the predicted one, at equal times, from a
    second before it until 20 m away (or half as far as the plan goes); or, if that is nearer, like
    the plan's own, which setpoints follow. What the flight does later does not move the clock: who
    pauses on the way is late from there on.
    """
    lines = (predicted, Line.planned(solution))
    off, start = min(departure(solution, line, flight) for line in lines)
    return start if off <= threshold.alike else None


def departure(solution: Solution, line: Line, flight: Line) -> tuple[float, float]:
    """Return the departure of `flight` that is most like that of `line`, as `plan_start` has it.

    How far it is from it, as a share of the way looked at, and when the clock of `line` read 0.
    """
    begin = set_out(solution.t, solution.w, solution.plan) - float(solution.t[0]) - MOST_LEAD
    begin = max(begin - threshold.before, float(line.t[0]))
    after = line.t > begin
    away = lengths(line.w[after] - solution.w[0])
    reach = min(threshold.reach, float(away.max()) / 2)
    end = float(line.t[after][np.argmax(away >= reach)])
    t = np.linspace(begin, end, max(2, round((end - begin) / 0.2)))
    w = line.at(t)
    first, last = float(flight.t[0]) - begin, float(flight.t[-1]) - end
    if last < first:
        return math.inf, 0.0

    def squares(starts: Real) -> Real:
        """Return the mean square distances of these `starts`, m²."""
        at = flight.at((starts[:, None] + t).ravel()).reshape(len(starts), *w.shape)
        return np.asarray(np.mean(np.sum((at - w) ** 2, axis=-1), axis=-1))

    coarse = np.arange(first, last + threshold.coarse, threshold.coarse)
    around = coarse[lengths(flight.at(coarse + begin) - w[0]) < reach]
    if not len(around):
        return math.inf, 0.0
    near = around[squares(around).argmin()]
    fine = np.clip(
        near + np.arange(-2 * threshold.coarse, 2 * threshold.coarse, threshold.fine), first, last
    )
    found = squares(fine)
    return math.sqrt(found.min()) / reach, float(fine[found.argmin()])


def standing(solution: Solution, predicted: Line, flight: Line) -> Standing:
    """Return how `flight`, on the plan's clock, stands at its last sample.

    It is priced as a predicted flight is (`price_flight`): as it was flown until now, and as it is
    predicted from where the plan stands.
    """
    now, place, ends = float(flight.t[-1]), flight.w[-1], float(solution.t[-1])
    behind = late(solution, now, place)
    ahead = predicted.t + behind > now
    t = np.concatenate([flight.t, predicted.t[ahead] + behind])
    priced = price_flight(solution, t, np.concatenate([flight.w, predicted.w[ahead]]))
    step = float(solution.t[1] - solution.t[0])
    slot = int(np.clip(now / step, 0, len(solution.t) - 1))
    forwarded, time_up = step * priced.relayed.forwarded, now >= solution.plan.flight.duration
    around_end = flight.w[flight.t >= ends - threshold.around_end]
    return Standing(
        time=now,
        late=behind,
        apart=float(lengths(place - Line.planned(solution).at(np.array([now])))[0]),
        astray=float(distances_to_path(place[None], solution.w)[0]),
        I_U=float(priced.I_U[slot]),
        I_G=float(priced.I_G[slot]),
        delivered=float(forwarded[: None if time_up else slot].sum()),
        expected=float(forwarded.sum()),
        over=time_up and bool((lengths(around_end - solution.w[-1]) < threshold.at_end).any()),
    )


def late(solution: Solution, now: float, place: Real) -> float:
    """Return by how many seconds an aircraft at `place` (2,), m, is later than planned at `now`."""
    t = np.arange(0.0, float(solution.t[-1]) + 0.05, 0.1)
    apart = lengths(Line.planned(solution).at(t) - place)
    return now - float(t[np.argmin(apart + threshold.metres_per_second * np.abs(t - now))])
