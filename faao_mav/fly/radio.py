"""What radios are told in flight: a line for each slot, with its precoders."""

import json
import socket
import time
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


class Radios:
    """Radios that take lines as datagrams at `to`, udp:HOST:PORT, in a flight of `solution`.

    They are told a slot whenever another is reached. By what slots are taken `taken_by` says: by
    time, or by place, of the slots planned there the one whose time is nearest. A radio that does
    not listen is no reason to stop a flight: what cannot be sent is dropped. Raises `InputError`
    for another `to`, and as `check_of_slots` does.
    """

    def __init__(self, solution: Solution, to: str) -> None:
        kind, _, where = to.partition(":")
        host, _, port = where.rpartition(":")
        if kind != "udp" or not host or not port.isdecimal() or not 0 < int(port) < 65_536:
            raise InputError(f"--radio {to}: expected udp:HOST:PORT, as in udp:127.0.0.1:5005")
        check_of_slots(solution)
        self._solution, self._to, self._last = solution, (host, int(port)), -1

    def line(self, t: float | None, w: Real) -> str | None:
        """Return the line of the slot of an aircraft at `w` (2,), m, if it is another than before.

        `t` is the time on the plan's clock, s; None while that is not known: then slots are taken
        by place while it is near flight.start. None, too, before and after the plan's time.

        It is a JSON object: `slot`; `t`, s; `east` and `north`, m, where the aircraft is; `P_B` and
        `P_U`, rows of [real, imaginary], sqrt(W); `receive_share`, null in full duplex; `step_B`
        and `step_U`, the numbers of the rates of both hops, null without `radio.rates`.
        """
        solution, plan = self._solution, self._solution.plan
        away = float(lengths(w - solution.w[0]))
        if not (away <= _NEAR if t is None else 0 <= t < plan.flight.duration):
            return None
        planned = now = 0.0 if t is None else t
        if t is None or taken_by(plan) == "place":
            planned -= late(solution, now, w)
        step = float(solution.t[1] - solution.t[0])
        slot = min(int(max(planned, 0.0) / step + 1e-9), len(solution.t) - 1)
        if slot == self._last:
            return None
        self._last = slot
        told = {
            "slot": slot,
            "t": t,
            "east": float(w[0]),
            "north": float(w[1]),
            "P_B": _pairs(solution.P_B[slot]),
            "P_U": _pairs(solution.P_U[slot]),
            "receive_share": None if solution.shares is None else float(solution.shares[slot]),
            "step_B": None if solution.steps is None else int(solution.steps[0][slot]),
            "step_U": None if solution.steps is None else int(solution.steps[1][slot]),
        }
        return json.dumps(told)

    def tell(self, t: float | None, w: Real) -> bool:
        """Send the line of that slot, if it is another one; tell whether it is."""
        line = self.line(t, w)
        if line is not None:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link, suppress(OSError):
                link.sendto(f"{line}\n".encode(), self._to)
        return line is not None

    def replay(self, flight: Line) -> int:
        """Tell the slots of a `flight` on the plan's clock at the pace at which it was flown.

        Return how many there were.
        """
        begin, count = time.monotonic(), 0
        during = (flight.t >= 0) & (flight.t < self._solution.plan.flight.duration)
        times = flight.t[during].tolist()
        for t, w in zip(times, flight.w[during], strict=True):
            time.sleep(max(0.0, begin + t - times[0] - time.monotonic()))
            count += self.tell(t, w)
        return count


def _pairs(P: Complex) -> list[list[list[float]]]:
    pairs: list[list[list[float]]] = np.stack([P.real, P.imag], axis=-1).tolist()
    return pairs
