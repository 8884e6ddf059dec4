"""When questions are repeated: on quick, slow, jittery and lossy links."""

from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.wire.transfer.pace import Pace, Timeouts

TIMES = Timeouts()


class Asker:
    """Who puts questions at a `Pace`, on a clock of its own."""

    def __init__(self, insists: float = float("inf")) -> None:
        self.pace = Pace(TIMES, insists)
        self.now = 0.0

    def ask(self, took: float, lost: int = 0) -> int:
        """Put a question that is answered `took` after the first asking that is not `lost`.

        Return how often it is put. The answers to further ones come later, before the next.
        """
        asked = [self.now]
        question = self.pace.ask(self.now)
        while len(asked) <= lost or asked[-1] + self.pace.wait < asked[lost] + took:
            asked.append(asked[-1] + self.pace.wait)
            self.pace.repeat(question, asked[-1])
        self.now = asked[lost] + took
        self.pace.answer(question, self.now)
        return len(asked)

    def ask_many(self, times: int, took: float) -> int:
        """Return how often `times` questions are put in all."""
        return sum(self.ask(took) for _ in range(times))


def settled(took: float) -> Asker:
    asker = Asker()
    asker.ask_many(20, took)
    return asker


def waits(asker: Asker, count: int) -> list[float]:
    """Return how long one question that is not answered waits each time."""
    question = asker.pace.ask(asker.now)
    found = []
    for _ in range(count):
        found.append(round(asker.pace.wait, 6))
        asker.pace.repeat(question, asker.now)
    return found


def test_before_any_answer_the_time_of_the_guide_is_doubled() -> None:
    assert waits(Asker(), 5) == [0.25, 0.5, 1.0, 1.5, 1.5]


def test_the_time_is_that_of_rfc_6298() -> None:
    asker = Asker()
    asker.ask(0.1)
    assert asker.pace.wait == pytest.approx(0.1 + 4 * 0.05)
    asker.ask(0.1)
    assert asker.pace.wait == pytest.approx(0.1 + 4 * 0.0375)
    asker.ask(0.18)
    assert asker.pace.wait == pytest.approx(0.11 + 4 * (0.75 * 0.0375 + 0.25 * 0.08))


def test_a_quick_link_is_not_asked_again_sooner_than_the_quickest() -> None:
    assert waits(settled(0.001), 1) == [TIMES.quickest]


def test_the_first_repetition_is_a_probe_and_further_ones_double() -> None:
    assert waits(settled(0.001), 7) == [0.02, 0.02, 0.04, 0.08, 0.16, 0.32, 0.5]


def test_after_a_loss_the_next_question_waits_as_usual() -> None:
    asker = settled(0.001)
    for _ in range(4):
        asker.ask(0.001, lost=3)
        assert asker.pace.wait == TIMES.quickest


def test_after_losses_in_a_row_it_waits_until_a_question_is_answered_at_once() -> None:
    asker = settled(0.001)
    for _ in range(6):
        asker.ask(0.001, lost=1)
    assert asker.pace.wait > TIMES.quickest
    asker.ask(0.001)
    assert asker.pace.wait == TIMES.quickest


@pytest.mark.parametrize("before", [0.002, 0.03, 0.1])
@pytest.mark.parametrize("after", [0.05, 0.075, 0.15, 0.24, 0.3, 0.45])
def test_a_link_that_becomes_slower_is_learned(before: Any, after: Any) -> None:
    asker = settled(before)
    assert asker.ask_many(50, after) <= 50 + 40
    assert asker.ask_many(50, after) <= 52


@pytest.mark.parametrize("after", [0.3, 0.7, 1.0, 1.4])
def test_answers_that_come_twice_tell_how_slow_it_has_become(after: Any) -> None:
    asker = settled(0.002)
    puts = 0
    for _ in range(20):
        times = asker.ask(after)
        puts += times
        for _ in range(times - 1):
            asker.pace.answer_again()
    assert puts <= 20 + 12


def test_one_answer_that_comes_twice_is_counted_once() -> None:
    one, two = settled(0.05), settled(0.05)
    for asker, times in ((one, 1), (two, 3)):
        asker.ask(0.4)
        for _ in range(times):
            asker.pace.answer_again()
    assert one.pace.wait == two.pace.wait > 0.4
    two.pace.answer_again()
    assert one.pace.wait == two.pace.wait


def test_what_comes_twice_after_an_answer_at_once_says_nothing() -> None:
    asker = settled(0.05)
    wait = asker.pace.wait
    asker.pace.answer_again()
    assert asker.pace.wait == wait


def test_who_asks_again_by_himself_is_not_taken_for_slow() -> None:
    """ArduPilot's request was lost; it asks again after a second, of which an item is no cause."""
    asker = Asker(insists=1.0)
    asker.ask_many(20, 0.002)
    for _ in range(4):
        question = asker.pace.ask(asker.now)
        asker.pace.answer(question, asker.now + 1.003)
        assert asker.pace.wait == TIMES.quickest


def test_a_question_put_once_more_on_request_measures_nothing() -> None:
    asker = settled(0.1)
    wait = asker.pace.wait
    question = asker.pace.ask(asker.now)
    question.send_again(asker.now)
    asker.pace.answer(question, asker.now + 0.001)
    assert asker.pace.wait == pytest.approx(wait)


@settings(max_examples=150)
@given(st.floats(0.001, 0.7), st.floats(0, 1), st.floats(0, 0.5), st.integers(0, 2**32))
def test_a_link_is_never_flooded(least: float, jitter: float, loss: float, seed: int) -> None:
    """Without duplicates to learn from: a tenth more questions than needed, once it is known."""
    random, asker = Random(seed), Asker()
    puts = needed = 0
    for _ in range(200):
        lost = 0
        while random.random() < loss:
            lost += 1
        puts += asker.ask(least * (1 + jitter * random.random()), lost)
        needed += 1 + lost
    assert puts <= 1.1 * needed + 10


def test_what_an_earlier_transfer_measured_holds_from_the_first_question() -> None:
    earlier = settled(0.03)
    later = Pace(TIMES, before=earlier.pace)
    assert later.wait == earlier.pace.wait < TIMES.item
    assert not later.is_doubtful
    assert Pace(TIMES, before=Pace(TIMES)).wait == TIMES.item
