"""A PX4 multicopter as a flight model."""

from dataclasses import dataclass
from math import hypot
from typing import ClassVar

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.model import SHORTEST, STEP, Copter, Flight, FlightPath, Flown
from faao_mav.autopilot.px4.guidance import FACTS, Axis, GuidedLeg, Px4Limits, follow


@dataclass(frozen=True, slots=True)
class Px4(Px4Limits):
    """How a PX4 multicopter flies plain waypoints in mission mode.

    A simulation of PX4's own chain: guidance with a look at the next waypoint only, smoothing
    within jerk and acceleration, a clock that runs slower while the aircraft lags behind, a
    cascaded controller and an aircraft with lag and drag. Fitted to recorded flights are the
    `body`, how the position estimate wanders, and `switch_delay`; the rest is PX4's. Limits are SI:
    m, m/s, m/s², m/s³; the defaults are those of PX4 1.16. Wind and the lean limit are left out:
    with the simulator's drag the controller's integral holds against a steady wind from the
    take-off on, and drag takes all of the lean limit at 49 m/s only.
    """

    # Two acceptance radii with which an aircraft half a metre off is in time. Chosen.
    least: ClassVar[float] = 5.0
    # Measured: an aircraft half a metre off comes so much sooner or later to its waypoint, a second
    # at 0.5 m/s.
    slowest: ClassVar[float] = 1.5

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg flown at `speed`, m; same shape.

        It must be able to stop at the next waypoint: d = v (v + b) / 2 a with b = 4 a² / j.

        >>> float(Px4(acceleration=5.0, jerk=10.0).shortest_leg(np.array(8.0)))
        14.4
        """
        a = self.acceleration
        return speed * (speed + 4 * a * a / self.jerk) / (2 * a)

    def radii(self, room: Real, turn: Real, stops: Flags) -> Real:
        """Return acceptance radii, m, for waypoints whose shorter leg is `room` (n,), m.

        A wider one costs less speed in a corner, of sqrt(a r tan(alpha / 2)) at the inner angle
        alpha, but cuts it: by r tan(turn / 4) about, `turn` (n,) in radians. Where it turns none is
        wider than the next: PX4 would first fly back to the waypoint. `stops` (n,)
        marks waypoints at which it waits: those are left from within.
        """
        cut = FACTS.cut / np.maximum(np.tan(turn / 4), 1e-9)
        wide = np.where(stops, FACTS.radius, np.maximum(FACTS.radius, cut))
        radii = np.maximum(np.minimum(wide, FACTS.radius_share * room), FACTS.least_radius)
        for k in reversed(np.flatnonzero((turn > np.radians(FACTS.straight)) & ~stops)):
            radii[k] = min(radii[k], radii[k + 1])
        return radii

    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds.

        Holds keep their fractions and count from entering the acceptance radius; speeds of 0 or
        less mean `cruise_speed`, radii of 0 `acceptance_radius`. Spline waypoints, which PX4
        refuses, are flown as plain ones. The end is when the last waypoint is done: the aircraft
        is then within its radius and may still be braking. Raises `InputError` for a flight of more
        than `path.longest` s: only flying tells how long it circles round a small radius.
        """
        route, hold = self.legs(path), float(path.holds[0])
        flight = _Flight(self, path)
        arrivals, departures = [0.0], [hold + FACTS.switch_delay if hold > 0 else 0.0]
        flight.time = departures[0]
        flight.keep_now()
        for leg in route:
            flight.arrive(leg)
            arrivals.append(flight.time)
            departures.append(flight.time + FACTS.switch_delay + leg.hold)
            flight.stay(leg, departures[-1])
        if route:
            flight.stay(route[-1], departures[-1] + max(step, STEP))
        return flight.flown(arrivals, departures, step)


class _Flight(Flight):
    """A flight along legs.

    A trajectory, `axes` east, north and up, is followed by the aircraft across the ground; its
    height is the trajectory's.
    """

    def __init__(self, limits: Px4Limits, path: FlightPath) -> None:
        super().__init__(path.longest)
        self._limits = limits
        self._axes = [Axis(each) for each in path.points[0].tolist()]
        self._climbs = float(np.ptp(path.points[:, 2])) > 0
        self._body = Copter(limits.body, complex(*path.points[0, :2]))
        self._integral, self._remembered, self._pace = 0j, 0.0, 1.0
        self.keep_now()

    def keep_now(self) -> None:
        """Keep where the aircraft is now."""
        up, body = self._axes[2], self._body
        self.keep(body.place, up.position, body.velocity, self._pace * up.velocity)

    def arrive(self, leg: GuidedLeg) -> None:
        """Fly along `leg` until its end is reached."""
        away, closing = self._away(leg), 0.0
        while away > 0:
            step = min(STEP, max(away / closing, SHORTEST)) if closing > 0 else STEP
            self._move(leg, step)
            before, away = away, self._away(leg)
            closing = (before - away) / step

    def stay(self, leg: GuidedLeg, until: float) -> None:
        """Go on towards the end of `leg`, where the aircraft is, `until` s."""
        while (left := until - self.time) > 1e-9:
            self._move(leg, min(STEP, left))

    def _away(self, leg: GuidedLeg) -> float:
        """Return how far the aircraft is from being accepted at the end, m; 0 and less is in."""
        up = abs(self._axes[2].position - leg.height)
        nearest = max(self._limits.height_radius, FACTS.nearest)
        return max(abs(self._body.place - leg.target) - leg.radius, up - nearest)

    def _move(self, leg: GuidedLeg, step: float) -> None:
        """Fly on for `step` s: what is asked for halfway is pursued all along it."""
        limits, body, axes = self._limits, self._body, self._axes
        east, north, up = axes
        place = complex(east.position, north.position)
        velocity = complex(east.velocity, north.velocity)
        midway, aim = place + velocity * (step / 2), limits.headed(leg, body.place)
        level = limits.level_setpoint(aim, midway, velocity, self._remembered)
        direction, speed, self._remembered = level
        lag = place - body.place
        self._pace = self._paced(lag, velocity)
        climb, most = 0.0, limits.acceleration
        if self._climbs:
            height = up.position + up.velocity * (step / 2)
            speed, climb = limits.climb_setpoint(aim, abs(aim.target - midway), height, speed)
        wanted, count = direction * speed, 3 if self._climbs else 2
        axes[:count] = follow(
            axes[:count],
            (wanted.real, wanted.imag, climb)[:count],
            (most, most, limits.vertical(climb)[1])[:count],
            limits.jerk,
            self._pace * step,
        )
        push = complex(
            east.acceleration + axes[0].acceleration, north.acceleration + axes[1].acceleration
        )
        lack = velocity + FACTS.position_gain * lag - body.velocity
        asked = push / 2 + FACTS.gain * lack + self._integral
        asked -= FACTS.derivative * body.acceleration
        self._integral += FACTS.integral * lack * step
        body.move(asked, step)
        self.time += step
        self.keep_now()

    def _paced(self, lag: complex, velocity: complex) -> float:
        """Return the rate of the trajectory's clock: 1 less the `lag`'s share of MPC_XY_ERR_MAX.

        An aircraft ahead of its trajectory does not hold it up. How far it is behind wavers with
        the position estimate: what waits is the mean over that.
        """
        if not velocity:
            return 1.0
        along = (lag * velocity.conjugate()).real / abs(velocity)
        behind = (along + hypot(along, FACTS.wander)) / 2
        return 1 - min(behind / self._limits.error_limit, 1.0)
