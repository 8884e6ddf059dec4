"""What the radios are told in flight: a line for each slot, with its precoders."""

import json
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InputError
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.precoder_table import check_of_slots, taken_by
from faao_mav.validate.flown import Line, late
from faao_mav.vector import lengths

_NEAR = 20.0
"""Before the plan's clock is known slots are told within so many metres of flight.start; chosen."""


class RadioFeed:
    """The lines for the radios of a flight of `solution`, one whenever another slot is reached.

    By what slots are taken `taken_by` says: by time, or by place, of the slots planned there the
    one whose time is nearest. Raises `InputError` as `check_of_slots` does.
    """

    def __init__(self, solution: Solution) -> None:
        check_of_slots(solution)
        self._solution, self._by = solution, taken_by(solution.plan)
        self._last = -1

    def line(self, t: float | None, w: Real) -> str | None:
        """Return the line of the slot of an aircraft at `w` (2,), m, if it is another than before.

        `t` is the time on the plan's clock, s; None while that is not known: then slots are taken
        by place while it is near flight.start. None, too, before and after the plan's time.

        It is a JSON object: `slot`; `t`, s; `east` and `north`, m, where the aircraft is; `P_B` and
        `P_U`, rows of [real, imaginary], sqrt(W); `receive_share`, null in full duplex.
        """
        solution, duration = self._solution, self._solution.plan.flight.duration
        if not (self._waits_at(w) if t is None else 0 <= t < duration):
            return None
        planned = now = 0.0 if t is None else t
        if t is None or self._by == "place":
            planned -= late(solution, now, w)
        step = float(solution.t[1] - solution.t[0])
        slot = min(int(max(planned, 0.0) / step + 1e-9), len(solution.t) - 1)
        if slot == self._last:
            return None
        self._last = slot
        shares = solution.shares
        told = {
            "slot": slot,
            "t": t,
            "east": float(w[0]),
            "north": float(w[1]),
            "P_B": _pairs(solution.P_B[slot]),
            "P_U": _pairs(solution.P_U[slot]),
            "receive_share": None if shares is None else float(shares[slot]),
        }
        return json.dumps(told)

    def _waits_at(self, w: Real) -> bool:
        return float(lengths(w - self._solution.w[0])) <= _NEAR


class UdpRadio:
    """Radios that take lines as datagrams at `to`: udp:HOST:PORT; raises `InputError` for others.

    A radio that does not listen is no reason to stop a flight: what cannot be sent is dropped.
    """

    def __init__(self, to: str) -> None:
        kind, _, where = to.partition(":")
        host, _, port = where.rpartition(":")
        if kind != "udp" or not host or not port.isdecimal() or not 0 < int(port) < 65_536:
            raise InputError(f"--radio {to}: expected udp:HOST:PORT, as in udp:127.0.0.1:5005")
        self._to = (host, int(port))

    def send(self, line: str) -> None:
        """Send `line`."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link, suppress(OSError):
            link.sendto(f"{line}\n".encode(), self._to)


def replayed(solution: Solution, flight: Line) -> Iterator[tuple[float, str]]:
    """Yield the lines of a `flight` on the plan's clock, each with its time, s."""
    feed = RadioFeed(solution)
    for t, w in zip(flight.t.tolist(), flight.w, strict=True):
        if (line := feed.line(t, w)) is not None:
            yield t, line


def replay(
    lines: Iterator[tuple[float, str]],
    send: Callable[[str], object],
    *,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], object] = time.sleep,
) -> int:
    """Send `lines` at the pace at which they were flown, and return how many there were."""
    begin, count = None, 0
    for t, line in lines:
        if begin is None:
            begin = clock() - t
        sleep(max(0.0, begin + t - clock()))
        send(line)
        count += 1
    return count


def _pairs(P: Complex) -> list[list[list[float]]]:
    pairs: list[list[list[float]]] = np.stack([P.real, P.imag], axis=-1).tolist()
    return pairs
