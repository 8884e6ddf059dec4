"""What fuzzers share: the two outcomes that hostile input may have, and the limits on both.

Input is read and gives a value, or is refused by one of the project's own errors, within
`SECONDS` of processor time and `MEGABYTES` of memory. Anything else is a `Finding`.
"""

import hashlib
import resource
import signal
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType

from faao_mav.errors import FaaoError

SECONDS = 5.0
"""Processor time of one case, s; chosen: "a few seconds"."""

MEGABYTES = 500
"""Memory of one case beyond what the process has before it, 10^6 bytes; chosen."""

_LONGEST_MESSAGE = 4000
"""Characters of the longest message; chosen: a refused plan names six keys on a screen."""

CORPUS = Path(__file__).parent / "corpus"
"""The folder that has one folder of found inputs for each target, by its name."""


class Finding(AssertionError):
    """Input led to something else than a value or an error of the project."""


class _TooLongError(BaseException):
    """A case has used up its time; no `except Exception` in the tested code hides it."""


@dataclass(frozen=True, slots=True)
class Target:
    """What is fuzzed: `run(content)` reads, `seeds` are sound inputs, `mutate` makes odd ones.

    `mutate(content, seeds, random)` returns an input near `content`.
    """

    name: str
    run: Callable[[bytes], object]
    seeds: Sequence[bytes]
    mutate: Callable[[bytes, Sequence[bytes], Random], bytes]

    @property
    def corpus(self) -> tuple[bytes, ...]:
        """The inputs that once were findings, in the order of their names."""
        return tuple(path.read_bytes() for path in sorted((CORPUS / self.name).glob("*")))


@contextmanager
def limited() -> Iterator[None]:
    """Let what runs inside have so much processor time and so much more memory than before.

    Beyond them it gets `_TooLongError` or MemoryError. Linux, main thread.
    """

    def stop(number: int, frame: FrameType | None) -> None:
        raise _TooLongError(f"more than {SECONDS:g} s of processor time")

    pages = int(Path("/proc/self/statm").read_text().split()[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = pages * resource.getpagesize() + MEGABYTES * 1_000_000
    before = signal.signal(signal.SIGPROF, stop)
    resource.setrlimit(resource.RLIMIT_AS, (most, hard))
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def outcome(target: Target, content: bytes) -> str:
    """Return the message with which `content` is refused, nothing where it has a value.

    Raises `Finding` for any other outcome, and for a message that is empty, too long or holds
    characters that a terminal acts on.
    """
    try:
        with limited():
            target.run(content)
    except FaaoError as error:
        message = str(error)
    except KeyboardInterrupt:
        raise
    except BaseException as failure:
        kind = type(failure).__name__
        raise Finding(f"{target.name}: {kind}: {failure}: {content[:200]!r}") from failure
    else:
        return ""
    if 0 < len(message) <= _LONGEST_MESSAGE and message.replace("\n", "").isprintable():
        return message
    raise Finding(f"{target.name}: message {message[:200]!r}: {content[:200]!r}")


def fuzz(target: Target, cases: int) -> Counter[str]:
    """Return how many of `cases` mutated inputs were read and how many were refused.

    Another number of cases draws others. Raises `Finding` with the input, which is added to the
    corpus.
    """
    random, inputs = Random(f"{target.name} {cases}"), (*target.seeds, *target.corpus)
    counts: Counter[str] = Counter()
    for _ in range(cases):
        content = target.mutate(random.choice(inputs), inputs, random)
        try:
            counts["refused" if outcome(target, content) else "read"] += 1
        except Finding:
            folder = CORPUS / target.name
            folder.mkdir(parents=True, exist_ok=True)
            (folder / hashlib.sha256(content).hexdigest()[:12]).write_bytes(content)
            raise
    return counts
