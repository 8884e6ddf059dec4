"""The flights that an aircraft can make: (11), (12), (13d)-(13f) and the ends of `flight:`.

Beyond the paper, which leaves v(N+1) unlimited, every sample of the speed is bounded by v_max:
the last one is flown too. a(N+1) moves nothing and is zero.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.plan import Plan, Vector
from faao_mav.vector import chord

LENGTH = 100.0
"""The unit of length inside the solvers, m: the extent of a mission is of the order of one.

Chosen; with 1 m instead Clarabel fails on (27), with residuals of exponential cones at 1e5.
"""


_WIND_IN_TURNS = 1 / math.sqrt(3)
"""The share of the wind that counts as speed in turns, beside the speed over ground.

With c^2 = ||v||^2 + ||u||^2 / 3, c is at least half the airspeed ||v - u|| in every wind u, with
equality where three quarters of it are wind from ahead: a plane that a strong wind holds at a place
may still turn. That half is chosen. Below a quarter of the airspeed, wind adds at most 2 % to c.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Positions w (m), velocities v (m/s) and accelerations a (m/s²), each (N + 2, 2)."""

    w: Real
    v: Real
    a: Real


@dataclass(frozen=True, slots=True)
class Kinematics:
    """The feasible set: w_I, w_F (2,), N + 2 = `slots`, delta_t, v_max, a_max, end velocities.

    An end velocity of None is free. `bound_first_acceleration` extends (13f) to n = 0. Beyond the
    paper, every sample of the airspeed v - `wind` is at least `min_speed`, for fixed wings do not
    hover, and at most `max_airspeed`, m/s. From each to the next its size falls by at most
    `most_fall`, m/s^2, and half its square rises by at most `most_power`, m^2/s^3: what drag takes
    and thrust gives, both finite or none. An acceleration is at most `most_turn`, rad/s, times the
    speed that counts in a turn (`turning`): guidance follows no faster turns.

    >>> kin = Kinematics(np.zeros(2), np.array([40.0, 0.0]), 9, 1.0, 6.0, 3.0, None, None, True)
    >>> flight = kin.follow(np.full((9, 2), [4.0, 0.0]))  # 4 m/s do not get there in 8 s: 5 m/s do
    >>> flight.w[-1].round(6).tolist()
    [40.0, 0.0]
    """

    start: Real
    end: Real
    slots: int
    time_step: float
    max_speed: float
    max_acceleration: float
    start_velocity: Real | None
    end_velocity: Real | None
    bound_first_acceleration: bool
    min_speed: float = 0.0
    max_airspeed: float = math.inf
    wind: Vector = (0.0, 0.0)
    most_fall: float = math.inf
    most_power: float = math.inf
    most_turn: float = math.inf

    @property
    def first_bounded_acceleration(self) -> int:
        """The least n for which (13f) holds."""
        return 0 if self.bound_first_acceleration else 1

    @property
    def even_rates(self) -> Vector:
        """How fast the speed may rise and fall whatever it is, with no turn, m/s^2."""
        rise = min(self.max_acceleration, self.most_power / self.max_speed)
        return rise, min(self.max_acceleration, self.most_fall)

    @property
    def wind_in_turns(self) -> float:
        """The speed that counts in turns at no speed over ground, m/s."""
        return _WIND_IN_TURNS * math.hypot(*self.wind)

    def turning(self, speed: float) -> float:
        """Return the largest acceleration at a `speed` over ground, m/s: m/s^2.

        >>> kin = Kinematics(np.zeros(2), np.zeros(2), 5, 1.0, 8.0, 2.0, None, None, True,
        ...                  most_turn=0.5)
        >>> kin.turning(3.0), kin.turning(6.0)
        (1.5, 2.0)
        """
        return min(self.max_acceleration, self.most_turn * math.hypot(speed, self.wind_in_turns))

    @property
    def turn_binds(self) -> bool:
        """Whether `most_turn` forbids what a_max allows, at some speed from the least up."""
        slowest = max(0.0, self.min_speed - math.hypot(*self.wind))
        return math.isfinite(self.most_turn) and self.turning(slowest) < self.max_acceleration

    def turn_limits(self, v: Real) -> Real:
        """Return what `most_turn` leaves of accelerations at velocities v (n, 2): (n - 1,), m/s^2.

        In a slot the mean of the squared speeds at both its ends counts.
        """
        squares = (v * v).sum(axis=1)
        counting = (squares[:-1] + squares[1:]) / 2 + self.wind_in_turns**2
        return np.asarray(self.most_turn * np.sqrt(counting))

    def longest_ways(self) -> tuple[Real, Real]:
        """Return the longest ways (N + 2,), m, from w_I until each slot, and from there to w_F.

        >>> kin = Kinematics(np.zeros(2), np.zeros(2), 5, 1.0, 3.0, 2.0, np.zeros(2), None, True)
        >>> [way.tolist() for way in kin.longest_ways()]
        [[0.0, 1.0, 3.5, 6.5, 9.5], [12.0, 9.0, 6.0, 3.0, 0.0]]
        """
        n, gain = np.arange(self.slots), self.max_acceleration * self.time_step
        ways = []
        for velocity, bounded in (
            (self.start_velocity, self.bound_first_acceleration),
            (self.end_velocity, True),
        ):
            speed = np.full(self.slots, self.max_speed)
            if velocity is not None:
                given = float(np.linalg.norm(velocity))
                speed = np.minimum(speed, given + gain * n) if bounded else speed
                speed[0] = given
            both = (speed[1:] + speed[:-1]) / 2
            ways.append(self.time_step * np.concatenate([[0.0], np.cumsum(both)]))
        return ways[0], ways[1][::-1]

    def speeds_along(self, direction: Real) -> Vector:
        """Return the least and the greatest speed along `direction` (2,), m/s.

        The least is above the greatest where there is none; those on the way back are left out
        where there is a least airspeed.

        >>> kin = Kinematics(np.zeros(2), np.zeros(2), 5, 1.0, 8.0, 2.0, None, None, True,
        ...                  max_airspeed=10.0, wind=(-6.0, 8.0))
        >>> kin.speeds_along(np.array([1.0, 0.0])), kin.speeds_along(np.array([0.0, 1.0]))
        ((-8.0, 0.0), (0.0, 8.0))
        """
        low, high = chord(self.wind, self.max_airspeed, direction)
        low, high = max(low, -self.max_speed), min(high, self.max_speed)
        if self.min_speed > 0:
            low = max(low, chord(self.wind, self.min_speed, direction)[1])
        return low, high

    def in_the_air(self) -> "Kinematics":
        """Return feasible flights in the frame that moves with the wind, which is calm there.

        They turn no faster than is allowed at their airspeed in every direction over ground.
        """
        wind, lasting = np.array(self.wind), self.time_step * (self.slots - 1)
        ahead = min(0.75, math.hypot(*wind) / self.min_speed) if self.min_speed > 0 else 0.75
        ends = self.start_velocity, self.end_velocity
        start, end = (None if v is None else v - wind for v in ends)
        return replace(
            self,
            end=self.end - lasting * wind,
            max_speed=min(self.max_airspeed, self.max_speed + math.hypot(*self.wind)),
            start_velocity=start,
            end_velocity=end,
            max_airspeed=math.inf,
            wind=(0.0, 0.0),
            # the share of an airspeed that counts in turns against the wind, or at least a half
            most_turn=self.most_turn * math.hypot(1 - ahead, _WIND_IN_TURNS * ahead),
        )

    def over_ground(self, flight: Trajectory) -> Trajectory:
        """Return the `flight`, one of `in_the_air`, as it is seen from the ground."""
        drift = self.time_step * np.arange(self.slots)[:, None] * self.wind
        return Trajectory(flight.w + drift, flight.v + self.wind, flight.a)

    def residuals(self, trajectory: Trajectory) -> dict[str, float]:
        """Return the largest violation of each constraint, in its own unit; 0 where it holds."""
        w, v, a, dt = trajectory.w, trajectory.v, trajectory.a, self.time_step
        speed, acceleration = np.linalg.norm(v, axis=1), np.linalg.norm(a, axis=1)
        airspeed, first = np.linalg.norm(v - self.wind, axis=1), self.first_bounded_acceleration
        missed = {
            "(11) position": w[1:] - w[:-1] - v[:-1] * dt - a[:-1] * dt**2 / 2,
            "(12) velocity": v[1:] - v[:-1] - a[:-1] * dt,
            "(13d) ends": w[[0, -1]] - [self.start, self.end],
        }
        if self.start_velocity is not None:
            missed["start velocity"] = v[0] - self.start_velocity
        if self.end_velocity is not None:
            missed["end velocity"] = v[-1] - self.end_velocity
        beyond = {
            "(13e) speed": speed - self.max_speed,
            "(13f) acceleration": acceleration[first:] - self.max_acceleration,
        }
        if self.min_speed > 0:
            beyond["minimum speed"] = self.min_speed - airspeed
        if math.isfinite(self.most_fall):
            power = np.diff(airspeed**2)[first:] / (2 * dt)
            beyond["fall of airspeed"] = np.diff(airspeed)[first:] / -dt - self.most_fall
            beyond["power of airspeed"] = power - self.most_power
        if math.isfinite(self.most_turn):
            beyond["turn"] = (acceleration[:-1] - self.turn_limits(v))[first:]
        if math.isfinite(self.max_airspeed):
            beyond["airspeed"] = airspeed - self.max_airspeed
        found = {name: float(np.abs(each).max()) for name, each in missed.items()}
        return found | {name: float(max(0.0, each.max())) for name, each in beyond.items()}

    def integrate(self, start_velocity: Real, acceleration: Real) -> Trajectory:
        """Follow (11) and (12) exactly from w_I with v(0) (2,) and a(n) (N + 2, 2).

        The accelerations are first changed by the least-squares correction that meets w_F and a
        given end velocity, so that a solver's tolerance does not add up along the flight.
        """
        dt, steps = self.time_step, self.slots - 1
        a, still = acceleration[:-1], [self.end - self.start - steps * dt * start_velocity]
        if self.end_velocity is not None:
            still.append(self.end_velocity - start_velocity)
        # what accelerations do to the last position, and velocity
        effect = np.stack([dt**2 * (steps - np.arange(steps) - 0.5), np.full(steps, dt)])
        effect = effect[: len(still)]
        a = a + effect.T @ np.linalg.solve(effect @ effect.T, np.array(still) - effect @ a)
        v = start_velocity + dt * np.vstack([np.zeros(2), np.cumsum(a, axis=0)])
        w = self.start + dt * np.vstack([np.zeros(2), np.cumsum((v[:-1] + v[1:]) / 2, axis=0)])
        return Trajectory(w, v, np.vstack([a, np.zeros(2)]))

    def follow(self, v: Real) -> Trajectory:
        """Return the flight at the speeds v (N + 2, 2), changed a little where the ends ask."""
        a = np.vstack([np.diff(v, axis=0) / self.time_step, np.zeros(2)])
        return self.integrate(v[0], a)


def kinematics(plan: Plan) -> Kinematics:
    """Return the feasible set of `plan`."""
    flight, vehicle = plan.flight, plan.vehicle
    rates = plan.aircraft.flight_model().speed_rates
    fastest = math.hypot(plan.max_ground_speed, _WIND_IN_TURNS * math.hypot(*plan.wind))
    ends = flight.start_velocity, flight.end_velocity
    first, last = (None if v is None else np.array(v, dtype=float) for v in ends)
    return Kinematics(
        start=np.array(flight.start, dtype=float),
        end=np.array(flight.end, dtype=float),
        slots=flight.slots,
        time_step=flight.time_step,
        max_speed=plan.max_ground_speed,
        max_acceleration=min(vehicle.max_acceleration, rates.turn * fastest),
        start_velocity=first,
        end_velocity=last,
        bound_first_acceleration=flight.bound_first_acceleration,
        min_speed=vehicle.min_speed,
        max_airspeed=plan.max_airspeed,
        wind=plan.wind,
        most_fall=rates.fall,
        most_power=rates.power,
        most_turn=rates.turn,
    )
