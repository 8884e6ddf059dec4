"""When the rest of a flight is solved again, from where on, and what becomes of the answer."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from faao_mav.mavlink.flying.course import Course, Setpoint
from faao_mav.mavlink.flying.itinerary import Itinerary
from faao_mav.optimizer.kinematics import Trajectory, kinematics
from faao_mav.optimizer.rest import FEWEST_SLOTS, Rest
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.schedule import positions_at
from faao_mav.validate.flown import Line, Standing, late, planned_line, standing

OFF = 1.0
"""From so many seconds of flight at the plan's top speed, by which the aircraft is elsewhere than
it has to be, the rest is solved again. Chosen: five times what an undisturbed stream is off."""

_ANSWER = 4.0
"""Seconds that the first answer may take, by the world's clock; each further one may take twice as
long. Chosen: the sample's rest takes 1 s of a processor."""

_QUESTIONS = 2
"""How often it is asked until the old course is kept for good; chosen."""

_APART = 15.0
"""Seconds, by the vehicle's clock, between a new course and the next question; chosen."""

_FORESIGHT = 10.0
"""Seconds, by the vehicle's clock, between two answers about a mission; chosen."""

_NEAR = 10.0
"""Metres within which an aircraft takes up the planned course again, as late as it is; chosen."""

_LEVEL, _CLIMB = 2.0, 1.0
"""From so many metres beside the planned height the aircraft first climbs or sinks to it, by at
most so many m/s; chosen."""

_MISSED = 1e-3
"""By how much a new course may miss where it begins, or a limit, in their own units. Chosen."""

_EDGE = 0.01
"""By how much, m, it may be nearer to the fence's edge than the margin: rounding. Chosen."""


class Solver(Protocol):
    """Who solves the rest of a flight, beside the stream, which goes on meanwhile."""

    def ask(self, rest: Rest, /) -> None:
        """Begin to solve `rest`; what was asked before counts no more."""

    def answer(self) -> Solution | str | None:
        """Return the flight, or why there is none; None: not yet."""


@dataclass(frozen=True, slots=True)
class Question:
    """What was asked: the way there, `meanwhile`, ends where the new course is to begin, `due`.

    Times are on the plan's clock, s.
    """

    rest: Rest
    meanwhile: Course
    due: float


def question(
    solution: Solution, flown: Line, t: float, now: Setpoint, lead: float
) -> Question | None:
    """Return the question for an aircraft that is at `now` at `t`, s; None: too little is left.

    `flown` is the flight until `t`, both on the plan's clock. The new course begins with a slot,
    `lead` s later or more. Until then the aircraft flies the planned course as late as it is; where
    that is far away, or the fence or the height between, it brakes, comes to the planned height,
    and the new course begins from rest.
    """
    step = float(solution.t[1])
    meanwhile, ready = _late_course(solution, t, now), t
    if meanwhile is None:
        meanwhile = _rest(solution, t, now)
        ready = meanwhile.end
    slot = math.ceil(max(ready, t + lead) / step - 1e-9)
    if slot > len(solution.t) - FEWEST_SLOTS:
        return None
    times = np.arange(t, slot * step, step / 2)
    ahead = np.array([meanwhile.at(each).position[:2] for each in times])
    places = positions_at(
        solution.t[:slot], np.append(flown.t, times), np.concatenate([flown.w, ahead])
    )
    begin = meanwhile.at(slot * step)
    rest = Rest(solution, slot, places, begin.position[:2], begin.velocity[:2])
    return Question(rest, meanwhile, slot * step)


def _late_course(solution: Solution, t: float, now: Setpoint) -> Course | None:
    """Return the planned course as late as an aircraft at `now` is; None where it is elsewhere."""
    plan, course = solution.plan, Course.of(solution)
    late_course = course.later(late(solution, t, now.position[:2]))
    there = late_course.at(t).position
    across, up = np.linalg.norm((there - now.position)[:2]), abs((there - now.position)[2])
    between = np.array([now.position[:2], there[:2]])
    covered = plan.keep_in is None or bool(plan.keep_in.covers_path(between))
    return late_course if across <= _NEAR and up <= _LEVEL and covered else None


def _rest(solution: Solution, t: float, now: Setpoint) -> Course:
    """Return the way of an aircraft at `now` to rest at the planned height."""
    flight, brake = solution.plan.flight, solution.plan.vehicle.max_acceleration
    velocity = np.array([*now.velocity[:2], 0.0])
    speed = float(np.linalg.norm(velocity))
    pieces = [(speed / brake, -brake * velocity / max(speed, 1e-9))]
    stop = Course.by(t, now.position, velocity, pieces)
    leg = np.array([stop.p[-1], [*stop.p[-1, :2], flight.altitude]])
    return stop.then(Course.through(leg, speed=_CLIMB, acceleration=_CLIMB))


def is_sound(asked: Question, answer: Solution) -> bool:
    """Tell whether `answer` begins where it was asked to, and keeps the limits and the fence."""
    rest, plan = asked.rest, asked.rest.solution.plan
    if answer.plan != plan or answer.w.shape != rest.solution.w.shape:
        return False
    ahead = slice(rest.slot, None)
    limits = replace(
        kinematics(plan),
        start=rest.place,
        start_velocity=rest.velocity,
        end_velocity=rest.solution.v[-1],
        slots=len(answer.t) - rest.slot,
        bound_first_acceleration=True,
    )
    missed = limits.residuals(Trajectory(answer.w[ahead], answer.v[ahead], answer.a[ahead]))
    if not max(missed.values()) <= _MISSED:
        return False
    if plan.fence is None or plan.keep_in is None:
        return True
    kept = plan.keep_in.inside(max(plan.fence.margin - _EDGE, 0.0))
    return bool(kept.covers_path(answer.w[ahead]))


class Replan:
    """Has `solver` solve the rest of a streamed `flight` again where it is off its plan.

    A new course, which is in time, is flown if it delivers more than the old one, late.

    `told` is what has happened, in words. `failed` tells that there is no new course for good: the
    old one is flown on.
    """

    def __init__(self, flight: Itinerary, solver: Solver) -> None:
        self._flight, self._solver = flight, solver
        self._asked: Question | None = None
        self._old = flight.course
        self._questions, self._not_before = 0, -math.inf
        self._must = False
        self.told: list[str] = []
        self.failed = False

    @property
    def asking(self) -> bool:
        """Whether an answer is awaited."""
        return self._asked is not None

    def forget(self) -> None:
        """Wait for no answer any more: somebody else flies."""
        if self._asked is not None:
            self._asked = None
            self._flight.divert(self._old)

    def begin(self, flown: Callable[[], Line], t: float, now: Setpoint, speed: float) -> None:
        """Ask, and take any new course, as after somebody else has flown it."""
        self._questions, self.failed, self._must = 0, False, True
        self._ask(flown, t, now, speed)

    def step(self, flown: Callable[[], Line], t: float, now: Setpoint, speed: float) -> None:
        """Take note of an aircraft that is at `now` at `t`, s on the plan's clock.

        `flown` is where it was until then; the vehicle's clock has `speed` s in one of the world's.
        """
        if self._asked is not None:
            self._hear(self._asked, flown, t, now, speed)
            return
        if self.failed or t < self._not_before:
            return
        away = np.linalg.norm((self._flight.course.at(t).position - now.position)[:2])
        off = float(away) / self._flight.solution.plan.max_ground_speed
        if off > OFF:
            self._questions, self._must = 0, False
            self.told.append(f"{off:.1f} s of flight off the plan: the rest is solved again")
            self._ask(flown, t, now, speed)

    def _ask(self, flown: Callable[[], Line], t: float, now: Setpoint, speed: float) -> None:
        lead = _ANSWER * 2**self._questions * max(speed, 1.0)
        if self._asked is None:
            self._old = self._flight.course
        asked = question(self._flight.solution, flown(), t, now, lead)
        if asked is None:
            self._give_up("too little of the flight is left")
            return
        self._questions += 1
        self._asked = asked
        self._flight.divert(asked.meanwhile)
        self._solver.ask(asked.rest)

    def _hear(
        self,
        asked: Question,
        flown: Callable[[], Line],
        t: float,
        now: Setpoint,
        speed: float,
    ) -> None:
        answer = self._solver.answer()
        if isinstance(answer, str):
            self._give_up(answer)
        elif answer is not None and not is_sound(asked, answer):
            self._give_up("the answer breaks the plan's limits")
        elif answer is not None and t < asked.due:
            self._asked, self._not_before = None, asked.due + _APART
            self._choose(asked, answer, flown())
        elif t >= asked.due and self._questions >= _QUESTIONS:
            self._give_up(f"no answer in time to {self._questions} questions")
        elif t >= asked.due:
            self._ask(flown, t, now, speed)

    def _choose(self, asked: Question, answer: Solution, flown: Line) -> None:
        """Take the new course if it delivers more than the old one does, as late as it is flown."""
        solution = asked.rest.solution
        kept = standing(solution, planned_line(solution), flown).expected
        rate = kept / solution.plan.flight.duration
        anew, old = data(answer, answer.delivered_rate), data(solution, rate)
        if self._must or answer.delivered_rate > rate:
            self._flight.divert(asked.meanwhile.until(Course.of(answer), asked.due), answer)
            self.told.append(f"a new course from {asked.due:.1f} s on, to deliver {anew}")
        else:
            self._flight.divert(self._old)
            self.told.append(f"the old course is kept: {old}, a new one would deliver {anew}")

    def _give_up(self, why: str) -> None:
        self._asked, self.failed = None, True
        self._flight.divert(self._old)
        self.told.append(f"no new course ({why})")


class Foresight:
    """Says of a mission's flight that is off its plan what it would gain by a new course.

    Nothing is changed; `solver` is asked once in a while.
    """

    def __init__(self, solution: Solution, solver: Solver) -> None:
        self._solution, self._solver = solution, solver
        self._asked: Question | None = None
        self._not_before = -math.inf

    def step(self, flown: Line, now: Setpoint, stands: Standing, speed: float) -> str | None:
        """Return what is known since the last step, in words; arguments as of `Replan.step`."""
        solution, t = self._solution, stands.time
        if self._asked is not None:
            answer, asked = self._solver.answer(), self._asked
            if answer is None:
                return None
            self._asked = None
            if isinstance(answer, str):
                return f"no new course would keep the plan's time ({answer})"
            if not is_sound(asked, answer):
                return None
            as_it_is = data(solution, stands.expected / solution.plan.flight.duration)
            anew = data(answer, answer.delivered_rate)
            return f"on a new course it would deliver {anew}, as it goes on {as_it_is}"
        off = stands.apart / solution.plan.max_ground_speed
        if off > OFF and t >= self._not_before:
            self._not_before = t + _FORESIGHT
            self._asked = question(solution, flown, t, now, _ANSWER * max(speed, 1.0))
            if self._asked is not None:
                self._solver.ask(self._asked.rest)
        return None


def data(solution: Solution, rate: float) -> str:
    """Return in words what `rate`, bit/s/Hz, is over the plan's time."""
    megabytes = solution.plan.megabytes(rate)
    if megabytes is not None:
        return f"{megabytes:.1f} MB"
    return f"{rate * solution.plan.flight.duration:.1f} bit/Hz"
