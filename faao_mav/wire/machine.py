"""Machines, talks and their questions: protocol logic without sockets, clocks or sleeping."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from faao_mav.wire.messages import CommandLong, Envelope, M, Message, Timesync
from faao_mav.wire.protocol import Address, MavCommand

K = TypeVar("K")
T = TypeVar("T")

AT_ONCE = -math.inf
"""What a talk yields that only wants its line."""

SILENCE = 9.0
"""Seconds that a transfer may get no further: PX4 asks again for 5 s, ArduPilot for 8 s."""

_QUICKEST, _FIRST, SLOWEST = 0.02, 0.25, 1.5
"""Seconds after which a question is put again: at the earliest, as ArduPlane's main loop turns 50
times a second; while it is not known how long answers take, and at the latest, by the guide."""

_LONGEST = 0.5
"""Seconds after which it is put again at the latest on a quick link. Chosen: without it, of 50
parameters over a link that loses a fifth each way one stays unread in 4 % of all readings."""

_GROWTH = 1.25  # By how much the wait grows with each question that has to be put again; chosen.


class Machine(ABC, Generic[T]):
    """What is run on a link, real or simulated.

    It is told the time in seconds and what arrived, and answers with what is to be sent. Whoever
    runs it calls `start` once, then `on` for each message and `tick` at `deadline`, until there is
    an `outcome`; `cancel` ends it early, `hang_up` where nobody can be told any more. What derives
    from it sets `_due`, the time of the next `_time_out`, and in the end `outcome`.
    """

    def __init__(self) -> None:
        self.outcome: T | None = None
        self._due = 0.0

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self.outcome is not None else self._due

    def start(self, now: float) -> Sequence[Message]:
        """Begin."""
        return self._time_out(now)

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take note of what arrived."""
        return () if self.outcome is not None else self._receive(envelope, now)

    def tick(self, now: float) -> Sequence[Message]:
        """Take note of the time."""
        due = self.deadline
        return () if due is None or now < due else self._time_out(now)

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Give up."""
        return ()

    def hang_up(self, now: float) -> Sequence[Message]:
        """End where nobody can be told any more: give up."""
        return self.cancel(now)

    @abstractmethod
    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Answer what arrived before the outcome."""

    @abstractmethod
    def _time_out(self, now: float) -> Sequence[Message]:
        """Do what is due now."""


class Script(Machine[T]):
    """A machine that runs a talk, whose outcome is not None, and the line that the talk is sent.

    A line knows the time `now`, s, and what was `heard`, None when time has passed. The talk keeps
    its `progress` there: what is going on, how much of it is done, and of how much (0: not
    counted).

    >>> def knock():
    ...     line = yield AT_ONCE
    ...     line.say("knock")
    ...     line = yield line.now + 2.0
    ...     return "nobody" if line.heard is None else "somebody"
    >>> script = Script(knock())
    >>> script.start(1.0), script.deadline, script.tick(3.0), script.outcome
    (['knock'], 3.0, [], 'nobody')
    """

    def __init__(self, talk: "Talk[T]") -> None:
        super().__init__()
        self._talk = talk
        next(talk)
        self._said: list[Message] = []
        self.now, self.progress = 0.0, ("starting", 0, 0)
        self.heard: Envelope | None = None

    def say(self, *messages: Message) -> None:
        """Send `messages` once the talk waits."""
        self._said += messages

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Close the talk: there is no outcome."""
        self._said, self._due = [], math.inf
        self._talk.close()
        return self._said

    def _time_out(self, now: float) -> Sequence[Message]:
        return self._receive(None, now)

    def _receive(self, envelope: Envelope | None, now: float) -> Sequence[Message]:
        self.now, self._said, self._due = now, [], AT_ONCE
        try:
            while self._due == AT_ONCE:
                self.heard, envelope = envelope, None
                self._due = self._talk.send(self)
        except StopIteration as end:
            self.outcome = end.value
        return self._said


Talk: TypeAlias = Generator[float, Script[Any], T]
"""A conversation: it yields until when it waits, s, and is sent its line when something is heard or
that time has come; `AT_ONCE` first. What it returns is the outcome of a `Script`; closed, it may
still say a word.
"""


class Pace:
    """How long to `wait` for an answer before it is asked for again, s.

    It is `_FIRST` at first, then the mean and four deviations of the time that answers take
    (RFC 6298). An answer to a question that was put again tells nothing of that time (Karn's rule):
    the wait grows, so that a link that has become slow is measured in the end.
    """

    def __init__(self) -> None:
        self.mean: float | None = None
        """Mean time of answers, s; None before the first one."""
        self._deviation = 0.0
        self.wait = _FIRST

    def repeat(self) -> None:
        """Note that a question has to be put again."""
        self.wait = min(_GROWTH * self.wait, SLOWEST)

    def answer(self, took: float) -> None:
        """Note how long the answer took to a question that was put once."""
        if self.mean is None:
            self.mean, self._deviation = took, took / 2
        else:
            self._deviation += (abs(took - self.mean) - self._deviation) / 4
            self.mean += (took - self.mean) / 8
        self.wait = min(max(self.mean + 4 * self._deviation, _QUICKEST), SLOWEST)


class _Question(NamedTuple):
    """What is said when it is late; when it was put last, s, and how often."""

    again: tuple[Message, ...]
    sent: float
    times: int


class Questions(Generic[K]):
    """Questions on a `line`, each under a key, which are put again at a `pace` until answered.

    They are over at the time `until`: `silence` seconds after they last got `further`.
    """

    def __init__(self, line: Script[Any], pace: Pace, silence: float) -> None:
        self._line, self.pace, self._silence = line, pace, silence
        self.asked: dict[K, _Question] = {}
        self.further()

    @property
    def over(self) -> bool:
        """Whether nothing was answered for too long."""
        return self._line.now >= self.until

    def further(self) -> None:
        """Note that it has got further."""
        self.until = self._line.now + self._silence

    def put(self, key: K, *messages: Message, again: tuple[Message, ...] = ()) -> None:
        """Put a question, or one under way once more; `again` is said instead once it is late."""
        self.asked[key] = _Question(again or messages, self._line.now, self.times(key) + 1)
        self._line.say(*messages)

    def times(self, key: K) -> int:
        """Return how often a question under way was put."""
        return self.asked[key].times if key in self.asked else 0

    def answer(self, key: K) -> bool:
        """Note that a question is answered; tell whether it was under way."""
        question = self.asked.pop(key, None)
        if question is not None and question.times == 1:
            self.pace.answer(self._line.now - question.sent)
        return question is not None

    def hear(self) -> Talk[Envelope | None]:
        """Return what is heard next; None once time has passed, and late ones were put again."""
        yield min([self.until, *map(self._due, self.asked.values())])
        if self._line.heard is None:
            late = {k: each for k, each in self.asked.items() if self._due(each) <= self._line.now}
            if any(each.times == 1 for each in late.values()):
                self.pace.repeat()
            for key, question in late.items():
                self.put(key, *question.again)
        return self._line.heard

    def _due(self, question: _Question) -> float:
        """Return when `question` is put again: each time after twice as long."""
        wait = self.pace.wait * 2.0 ** min(question.times - 1, 8)  # beyond the longest
        return question.sent + min(wait, max(_LONGEST, self.pace.wait))


def ask(
    what: str, question: Message, answer: Callable[[Envelope], T | None], patience: float = 3.0
) -> Talk[T | None]:
    """Put one question until it is answered, for `patience` seconds; return the answer, or None.

    `answer` returns what an envelope says to it, None for nothing; `what` is being done in words.
    """
    line = yield AT_ONCE
    line.progress = what, 0, 0
    questions = Questions[str](line, Pace(), patience)
    questions.put(what, question)
    while not questions.over:
        heard = yield from questions.hear()
        if heard is not None and (found := answer(heard)) is not None:
            return found
    return None


def ask_for(vehicle: Address, number: int, kind: type[M]) -> Talk[M | None]:
    """Ask `vehicle` for its message of the type `kind` and that `number`."""
    question = CommandLong(vehicle, MavCommand.REQUEST_MESSAGE, 0, float(number))
    what = f"asking for {kind.__name__}"
    return ask(what, question, lambda heard: heard.said(vehicle, kind))


def ask_alive(vehicle: Address, number: int) -> Talk[bool]:
    """Ask for the answer to a `number` that nobody could know before; tell whether it comes.

    One that reads MAVLink 1 alone does not give it. On a link that is signed a recording cannot,
    and what was recorded before the answer is older than it: it is passed over from then on.
    """

    def answer(heard: Envelope) -> bool | None:
        told = heard.said(vehicle, Timesync)
        return (told and told.tc1 != 0 and told.ts1 == number) or None

    said = yield from ask("asking for a sign of life", Timesync(0, number), answer, SILENCE)
    return said is not None
