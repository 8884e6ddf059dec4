"""The rest of a streamed flight, solved again: when, from where on, and what becomes of answers."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest
from conftest import FLYABLE, edited
from hypothesis import given
from hypothesis import strategies as st
from scenes import AnotherStation, Scene
from simulate import Station
from stations import FOREIGN
from test_stream import FENCE, KINDS, LOITER, LOW, setpoints

from faao_mav import optimize, parse_plan
from faao_mav.errors import FaaoError
from faao_mav.mavlink.faults import Faults
from faao_mav.mavlink.flying.course import Course, Setpoint
from faao_mav.mavlink.flying.replan import Foresight, is_sound, question
from faao_mav.mavlink.flying.solving import ProcessSolver
from faao_mav.optimizer.rest import Rest, solve_rest
from faao_mav.optimizer.solution import Solution
from faao_mav.validate.flown import Line, planned_line, standing

LONG = LOW | {"flight.duration": 40, "mission.on_finish": "land"}


@cache
def long() -> Solution:
    """Return 40 s at up to 6 m/s, 24 s of which the aircraft can wait."""
    return optimize(parse_plan(edited(FLYABLE, LONG)))


def solved(rest: Rest) -> Solution | str:
    try:
        return solve_rest(rest)
    except FaaoError as error:
        return str(error)


@dataclass
class Scripted:
    """A solver that answers at the `polls`-th look, what `make` makes of the question."""

    polls: int = 5
    make: Callable[[Rest], Solution | str] = solved
    asked: list[Rest] = field(default_factory=list)
    answers: list[Solution | str] = field(default_factory=list)
    looks: int = 0

    def ask(self, rest: Rest) -> None:
        self.asked.append(rest)
        self.looks = 0

    def answer(self) -> Solution | str | None:
        self.looks += 1
        if self.looks < self.polls:
            return None
        self.answers.append(self.make(self.asked[-1]))
        return self.answers[-1]


def apart(scene: Scene) -> float:
    """Return how far the aircraft was at the end of the plan's time from where it was to be, m."""
    flown = scene.watch.seen.samples.record().line(long())
    t = flown.t - scene.watch.relay_start
    return float(np.linalg.norm(flown.w[np.searchsorted(t, long().t[-1])] - long().w[-1]))


SILENCE = Faults(outages=((23.0, 31.0),))
"""The relay flight begins after 20.9 s."""


def test_after_a_silence_there_is_a_new_course_that_keeps_the_plans_time() -> None:
    solver = Scripted()
    scene = Scene("ardupilot", solution=long(), solver=solver)
    assert scene.run(SILENCE) == "finished"
    assert scene.told("the rest is solved again")
    assert scene.told("a new course from")
    assert scene.watch.solution is solver.answers[0]
    assert apart(scene) < 1.0
    # it takes up the course where it is: no setpoint jumps by more than it could fly
    sent = [np.array([each.x, each.y]) for each in setpoints(scene)]
    times = np.array([each.time_boot_ms for each in setpoints(scene)]) / 1000
    steps = np.linalg.norm(np.diff(sent, axis=0), axis=1)
    after = times[1:] > 31.5 + 1.5
    assert (steps[after] < 6.0 * np.diff(times)[after] + 1.5).all()


@KINDS
def test_an_undisturbed_flight_is_left_alone(kind: str) -> None:
    scene = Scene(kind, solution=long(), solver=(solver := Scripted()))
    assert scene.run() == "finished"
    assert solver.asked == []
    assert scene.watch.solution is long()


def refuse(_: Rest) -> str:
    return "there is no flight"


def too_quick(rest: Rest) -> Solution:
    """Return a solution that is twice as quick as the aircraft may be."""
    answer = solve_rest(rest)
    return replace(answer, v=2 * answer.v)


def elsewhere(rest: Rest) -> Solution:
    """Return a solution that begins 3 m beside the place that was asked for."""
    return solve_rest(replace(rest, place=rest.place + np.array([3.0, 0.0])))


@pytest.mark.parametrize(
    ("solver", "words"),
    [
        (Scripted(polls=10_000), "no answer in time to 2 questions"),
        (Scripted(polls=120), "no answer in time to 2 questions"),  # later than both were due
        (Scripted(make=refuse), "there is no flight"),
        (Scripted(make=too_quick), "breaks the plan's limits"),
        (Scripted(make=elsewhere), "breaks the plan's limits"),
    ],
)
def test_without_a_good_answer_the_old_course_is_kept(solver: Scripted, words: str) -> None:
    scene = Scene("ardupilot", solution=long(), solver=solver)
    assert scene.run(SILENCE) == "finished"
    assert scene.told(f"no new course ({words}") or scene.told(words)
    assert scene.watch.solution is long()
    last = setpoints(scene)[-1]
    place = Course.of(long()).p[-1]
    assert np.allclose([last.y, last.x], place[:2], atol=0.1)
    # never a gap: the stream goes on while it is asked
    sent = np.array([each.time_boot_ms for each in setpoints(scene)])
    heard = sent[sent > 31_500]
    assert np.diff(heard).max() <= 120


def test_a_late_answer_to_the_first_question_does_not_count() -> None:
    solver = Scripted(polls=60)  # 6 s: after the first is due, before the second is
    scene = Scene("ardupilot", solution=long(), solver=solver)
    assert scene.run(SILENCE) == "finished"
    assert len(solver.asked) == 2
    assert scene.watch.solution is solver.answers[-1]
    assert solver.asked[1].slot > solver.asked[0].slot


def test_handed_back_it_goes_on_from_where_the_pilot_left_it() -> None:
    solver = Scripted()
    scene = Scene("ardupilot", solution=long(), solver=solver)
    sent = list[int]()
    events = [
        (23.0, scene.sets(LOITER)),
        (24.5, lambda _: sent.append(len(setpoints(scene)))),
        (27.0, scene.sets(scene.watch._guided)),
        (28.0, lambda _: sent.append(len(setpoints(scene)))),
    ]
    assert scene.run(events=events) == "finished"
    assert sent[0] == sent[1]
    assert scene.told("handed back")
    assert apart(scene) < 1.0
    first = setpoints(scene)[sent[1]]
    flown = scene.watch.seen.samples.record().line(long())
    there = flown.w[np.searchsorted(flown.t, first.time_boot_ms / 1000)]
    assert np.linalg.norm(there - [first.y, first.x]) < 1.0


@pytest.mark.parametrize("reason", ["no answer", "another station", "too late", "on the way out"])
def test_what_is_not_handed_back_stays_the_pilots(reason: str) -> None:
    solver = Scripted(make=refuse if reason == "no answer" else solved)
    scene = Scene("ardupilot", solution=long(), solver=solver)
    begin, back = {"too late": (23.0, 64.0), "on the way out": (17.0, 21.0)}.get(
        reason, (23.0, 27.0)
    )
    sent = list[int]()
    events = [
        (begin, scene.sets(LOITER)),
        (back, scene.sets(scene.watch._guided)),
        (back + 5.0, lambda _: sent.append(len(scene.orders))),
        (back + 9.0, scene.does(400, 0)),
    ]
    stations = [Station(AnotherStation(since=10.0), FOREIGN)]
    others = stations if reason == "another station" else []
    assert scene.run(events=events, others=others) == "taken over"
    assert len(scene.orders) == sent[0]
    if reason != "no answer":
        before = [each for each in setpoints(scene) if each.time_boot_ms / 1000 > back]
        assert before == []


def test_a_pilot_who_takes_it_while_it_is_asked_has_it() -> None:
    solver = Scripted(polls=20)
    scene = Scene("ardupilot", solution=long(), solver=solver)
    sent = list[int]()
    events = [
        (32.0, scene.sets(LOITER)),
        (33.5, lambda _: sent.append(len(scene.orders))),
        (45.0, scene.does(400, 0)),
    ]
    assert scene.run(SILENCE, events=events) == "taken over"
    assert solver.asked
    assert solver.answers == []
    assert len(scene.orders) == sent[0]


def fenced() -> Solution:
    """Return the flight for a plan with a fence, which it keeps."""
    return replace(long(), plan=parse_plan(edited(FLYABLE, LONG | {"fence": FENCE})))


@given(
    t=st.floats(3.0, 25.0),
    east=st.floats(-12.0, 62.0),
    north=st.floats(-12.0, 62.0),
    velocity=st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
    height=st.floats(3.0, 12.0),
)
def test_until_the_new_course_begins_the_limits_are_kept(
    t: float, east: float, north: float, velocity: tuple[float, float], height: float
) -> None:
    solution = fenced()
    plan, place = solution.plan, np.array([east, north, height])
    now = Setpoint(place, np.array([*velocity, 0.0]), np.zeros(3))
    line = planned_line(solution)
    flown = Line(line.t[line.t <= t], line.w[line.t <= t])
    asked = question(solution, flown, t, now, 2.5)
    assert asked is not None
    assert asked.due >= t + 2.5 - 1e-6
    assert asked.due == pytest.approx(asked.rest.slot * 0.5)
    begin = asked.meanwhile.at(asked.due)
    assert begin.position == pytest.approx([*asked.rest.place, 6.0])
    assert np.linalg.norm(begin.velocity) <= plan.max_ground_speed + 1e-9
    assert np.linalg.norm(asked.meanwhile.a, axis=1).max() <= plan.vehicle.max_acceleration + 1e-9
    assert np.linalg.norm(asked.meanwhile.at(t).position - place) <= 10.2
    assert len(asked.rest.flown) == asked.rest.slot


@pytest.mark.parametrize(("place", "speed"), [((25.0, 40.0), 3.0), ((5.0, 5.0), 0.0)])
def test_new_courses_keep_the_limits_and_the_fence(
    place: tuple[float, float], speed: float
) -> None:
    solution = fenced()
    plan, area = solution.plan, solution.plan.keep_in
    assert area is not None
    line = planned_line(solution)
    flown = Line(line.t[:12], line.w[:12])
    now = Setpoint(np.array([*place, 6.0]), np.array([speed, 0.0, 0.0]), np.zeros(3))
    asked = question(solution, flown, 6.0, now, 2.5)
    assert asked is not None
    answer = solve_rest(asked.rest)
    assert is_sound(asked, answer)
    course = asked.meanwhile.until(Course.of(answer), asked.due)
    times = np.arange(asked.due, course.end + 1, 0.02)
    p, v = (np.array([course.at(x)[k][:2] for x in times]) for k in (0, 1))
    np.testing.assert_allclose(np.diff(p, axis=0) / 0.02, (v[1:] + v[:-1]) / 2, atol=0.05)
    assert np.linalg.norm(v, axis=1).max() <= plan.max_ground_speed + 1e-6
    assert area.inside(1.99).covers(p).all()
    assert answer.t is solution.t
    assert np.allclose(answer.w[-1], solution.w[-1], atol=1e-6)


def test_of_a_mission_it_is_said_what_a_new_course_would_deliver() -> None:
    solution, solver = long(), Scripted(polls=1)
    foresight = Foresight(solution, solver)
    line = planned_line(solution)
    late = Line(np.append(line.t[:5], 8.0), np.append(line.w[:5], line.w[4:5], axis=0))
    now = Setpoint(np.append(late.w[-1], 6.0), np.zeros(3), np.zeros(3))
    stands = standing(solution, line, late)
    assert foresight.step(late, now, stands, 1.0) is None
    told = foresight.step(late, now, stands, 1.0)
    answer = solver.answers[0]
    assert isinstance(answer, Solution)
    rate = answer.delivered_rate * 40
    assert told == (
        f"on a new course it would deliver {rate:.1f} bit/Hz, "
        f"as it goes on {stands.expected:.1f} bit/Hz"
    )


def test_another_process_answers_and_says_why_not() -> None:
    solution = long()
    with ProcessSolver() as solver:
        for velocity in (np.zeros(2), np.array([60.0, 0.0])):
            rest = Rest(solution, 30, solution.w[:30], solution.w[30], velocity)
            solver.ask(rest)
            assert solver._answer is not None
            solver._answer.exception(timeout=60)
            answer, own = solver.answer(), solved(rest)
            if isinstance(own, str):
                assert answer == own
            else:
                assert isinstance(answer, Solution)
                assert answer.w.tobytes() == own.w.tobytes()
        for process in list(solver._pool._processes.values()):
            process.terminate()
            process.join()
        rest = Rest(solution, 30, solution.w[:30], solution.w[30], np.zeros(2))
        solver.ask(rest)
        assert solver._answer is not None
        solver._answer.exception(timeout=60)
        answer = solver.answer()
        assert isinstance(answer, str)
        assert "ended" in answer
