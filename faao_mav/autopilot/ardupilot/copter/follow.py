"""How the aircraft follows its target, and how the target waits for the aircraft.

Places, velocities and accelerations across the ground are complex: east + i north, in m and s.
"""

import math
from array import array
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.ardupilot.copter.course import GRID, Course
from faao_mav.autopilot.ardupilot.copter.parameters import ArduCopterLimits
from faao_mav.errors import InputError
from faao_mav.vector import Vector

_MARGIN = 0.05
"""The share by which an aircraft may be slower than its target before the target's clock waits for
it. The autopilot's own."""

_STANDING = 1e-5
"""The sum of an aircraft's speed and its error, m/s, and acceleration, m/s², below which it stands
until a hold is over. Chosen: ten times more changed arrivals by up to 0.1 s after a leg at 0.13
m/s."""

_HEADED = 0.5
"""The speed of the target, m/s, above which the aircraft's nose is along the target's way. Chosen;
what a change costs is not measured."""


@dataclass(frozen=True, slots=True, eq=False)
class Pursuit:
    """The flight at the times `t` (k,), s, every `GRID` seconds from 0.

    `clock` (k,), s, is the target's time and `rate` (k,) how fast it runs; `position` and
    `velocity` (k, 2) are the aircraft's, m and m/s east and north. `arrivals` (stops,), s, are
    when the target came to the stops.
    """

    t: Real
    clock: Real
    rate: Real
    position: Real
    velocity: Real
    arrivals: Real


def pursue(
    course: Course,
    motion: Real,
    limits: ArduCopterLimits,
    *,
    wind: Vector = (0.0, 0.0),
    longest: float = math.inf,
) -> Pursuit:
    """Return the flight along `course` up to the end of its last hold.

    `motion` (n, 9) is the target's on its clock, as `motion_of` gives it. The flight begins in a
    hover, nose to the north, held against the `wind`, m/s, by the integral.

    Raises `InputError` for one that takes more than `longest` s, as in wind that carries it away.
    """
    target, clock = _Target(motion), _Clock(course, limits)
    body = _Body(limits, complex(*motion[0, :2]), complex(*wind))
    controller = _Controller(limits, body.lean)
    log = array("d", _sample(clock, body))
    count, now = 0, 0.0
    while clock.runs(now):
        if now > longest:
            raise InputError(
                f"the flight would take more than {longest:.0f} s, perhaps for the wind"
            )
        place, velocity, push, climb = target.at(clock.time)
        waits = now < clock.resume
        if waits:  # at rest, though samples on both sides are not
            velocity = push = 0j
        error = controller.error(place - body.place, clock.speed())
        clock.adapt(1.0 if waits else controller.pace(error, velocity, climb, body.velocity))
        asked = controller.asked(error, velocity, push, body.velocity)
        if abs(velocity) > _HEADED:
            body.nose = velocity / abs(velocity)
        body.move(asked)
        count += 1
        clock.run(now, GRID * count)
        now = GRID * count
        log.extend(_sample(clock, body))
        unrest = abs(body.velocity) + abs(controller.lack) + abs(body.acceleration)
        if now < clock.resume and unrest < _STANDING:
            idle = int((clock.resume - now) / GRID)
            log.extend(log[-6:] * idle)
            count += idle
            now = GRID * count
    flight = np.frombuffer(log).reshape(-1, 6)
    return Pursuit(
        t=GRID * np.arange(len(flight), dtype=float),
        clock=flight[:, 0],
        rate=flight[:, 1],
        position=flight[:, 2:4],
        velocity=flight[:, 4:],
        arrivals=np.array(clock.arrivals),
    )


def _sample(clock: "_Clock", body: "_Body") -> tuple[float, ...]:
    place, velocity = body.place, body.velocity
    return (clock.time, clock.rate, place.real, place.imag, velocity.real, velocity.imag)


class _Target:
    """Where the target is, from its `motion` (n, 9) every `GRID` s of its clock."""

    def __init__(self, motion: Real) -> None:
        east, north = motion[:, ::3].T, motion[:, 1::3].T
        self._rows = list(zip(*(east + 1j * north).tolist(), motion[:, 5].tolist(), strict=True))

    def at(self, time: float) -> tuple[complex, complex, complex, float]:
        """Return place, velocity, acceleration and climb rate at `time`, s, of its clock."""
        k = min(int(time / GRID), len(self._rows) - 2)
        share = time / GRID - k
        (p, v, a, c), (p1, v1, a1, c1) = self._rows[k : k + 2]
        return (
            p + share * (p1 - p),
            v + share * (v1 - v),
            a + share * (a1 - a),
            c + share * (c1 - c),
        )


class _Clock:
    """The target's clock, which slows down for an aircraft behind and stands at stops.

    Its `time`, s, goes on at the `rate`; at stops it goes on when the flight has taken `resume` s.
    The rate follows what is asked for with the time constant A/J. `arrivals`, s of the flight, are
    those at the stops so far.
    """

    def __init__(self, course: Course, limits: ArduCopterLimits) -> None:
        self.time, self.rate, self.resume = 0.0, 1.0, course.wait
        self.arrivals: list[float] = []
        self._adapting = -math.expm1(-GRID * limits.jerk / limits.acceleration)
        self._stops = iter(course.stops)
        self._stop = next(self._stops, None)
        self._commands = list(zip(course.passed.tolist(), course.speeds, strict=False))[::-1]
        self._speed = math.inf

    def runs(self, now: float) -> bool:
        """Tell whether the flight, `now` s old, is not over."""
        return self._stop is not None or now < self.resume

    def speed(self) -> float:
        """Return the speed that is commanded now, m/s."""
        while self._commands and self.time >= self._commands[-1][0]:
            self._speed = self._commands.pop()[1]
        return self._speed

    def adapt(self, pace: float) -> None:
        """Let the rate go towards `pace` for a step."""
        self.rate += (pace - self.rate) * self._adapting

    def run(self, begin: float, end: float) -> None:
        """Go on from `begin` to `end`, s of the flight, but for what part of it is a stop."""
        free = max(begin, self.resume)
        while self._stop is not None and free < end:
            ahead = self.time + self.rate * (end - free)
            if ahead < self._stop.time:
                self.time = ahead
                return
            left = (self._stop.time - self.time) / self.rate if self.rate > 0 else 0.0
            self.arrivals.append(free + left)
            self.time = self._stop.time
            self.resume = free = self.arrivals[-1] + self._stop.wait
            self._stop = next(self._stops, None)


class _Controller:
    """The position controller: what it asks of the aircraft.

    It asks for the target's acceleration plus what the errors call for, up to the lean limit, where
    the `integral`, m/s², stands still. `lack`, m/s, is what the velocity was off in the last step.
    """

    def __init__(self, limits: ArduCopterLimits, integral: complex) -> None:
        self.integral, self.lack = integral, 0j
        self._limits, self._lean = limits, limits.lean
        self._speed, self._farthest = math.inf, math.inf

    def error(self, offset: complex, speed: float) -> complex:
        """Return how much of the target's `offset`, m, counts where `speed`, m/s, is commanded."""
        if speed != self._speed:
            self._speed, self._farthest = speed, self._limits.farthest(speed)
        return offset * self._farthest / far if (far := abs(offset)) > self._farthest else offset

    def pace(self, error: complex, target: complex, climb: float, velocity: complex) -> float:
        """Return the rate asked of the target's clock, 0 to 1.

        It is the aircraft's speed along the target's, less the position error times its gain, over
        the target's speed, plus a margin.
        """
        square = abs(target) ** 2 + climb**2
        if square <= 1e-9:
            return 1.0
        kept = (velocity - self._limits.position_gain * error) * target.conjugate()
        return min(max(_MARGIN + (kept.real + climb**2) / square, 0.0), 1.0)

    def asked(self, error: complex, target: complex, push: complex, velocity: complex) -> complex:
        """Return the acceleration that is asked for, m/s²; `push` is the target's."""
        limits, before = self._limits, self.integral
        self.lack = target + limits.position_gain * error - velocity
        self.integral += limits.velocity_integral * self.lack * GRID
        asked = push + limits.velocity_gain * self.lack + before
        if abs(asked) <= self._lean:
            return asked
        if (self.lack * asked.conjugate()).real > 0 and (grown := abs(self.integral)) > 0:
            self.integral *= min(1.0, abs(before) / grown)
        return _cut(asked, target, self._lean)


def _cut(asked: complex, target: complex, lean: float) -> complex:
    """Return `asked` cut to `lean`, m/s²: what is across the way of the `target` comes first."""
    if abs(target) < 1e-6:
        return asked * lean / abs(asked)
    way = target / abs(target)
    turned = asked * way.conjugate()
    across = min(lean, max(-lean, turned.imag))
    most = math.sqrt(lean * lean - across * across)
    return complex(min(most, max(-most, turned.real)), across) * way


class _Body:
    """The aircraft: it leans with a lag, and the air, which moves at `wind`, m/s, drags at it.

    It drags along the `nose`, a direction, and across, each by k v + q v |v|. (Measured in the
    simulator: with the lean limit at 10.3 m/s the air comes from ahead, at 10.8 and 11.0 m/s 21 and
    25 degrees from there.) `lean` is what leaning gives, `acceleration` what is left, m/s².
    """

    def __init__(self, limits: ArduCopterLimits, place: complex, wind: complex) -> None:
        self.place, self.velocity, self.nose = place, 0j, 1j
        self.acceleration = 0j
        self._wind, self._body = wind, limits.body
        self._leaning = -math.expm1(-GRID / limits.body.lag)
        self.lean = self._drag()

    def move(self, asked: complex) -> None:
        """Fly on for a step with the acceleration `asked`, m/s²."""
        self.lean += (asked - self.lean) * self._leaning
        self.acceleration = self.lean - self._drag()
        change = self.acceleration * GRID
        self.place += (self.velocity + change / 2) * GRID
        self.velocity += change

    def _drag(self) -> complex:
        """Return the deceleration by the air, m/s²."""
        air = (self.velocity - self._wind) * self.nose.conjugate()
        k, q = self._body.linear_drag, self._body.quadratic_drag
        along, across = air.real, air.imag
        return self.nose * complex((k + q * abs(along)) * along, (k + q * abs(across)) * across)
