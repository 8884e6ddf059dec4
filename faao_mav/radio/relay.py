"""What a relay delivers: it cannot forward what it has not received.

Per slot n the relay receives r_n and forwards f_n, and q_n waits in its queue, all in bits per
slot and hertz of bandwidth:

    q_0 = 0,    q_{n+1} = q_n + r_n - f_n,    0 <= f_n <= q_n,    0 <= r_n,    q_n <= buffer

so that what comes in during slot n leaves from slot n + 1 on. A relay on two bands (full duplex)
has r_n <= I_U,n and f_n <= I_G,n of (7), (8); one that shares a band between both hops (half
duplex) has r_n / I_U,n + f_n / I_G,n <= 1. The delivered rate is the mean of f_n, bit/s/Hz.

Source: information causality of Zeng, Zhang and Lim, "Throughput Maximization for UAV-Enabled
Mobile Relaying Systems", IEEE Transactions on Communications, 2016.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError

_SAME = 1e-9
"""The difference of two slopes below which they are one: rounding alone makes equal rates differ.
Chosen; without it the rates of a circle about one place make millions of stairs."""


@dataclass(frozen=True, slots=True, eq=False)
class Relayed:
    """What came in, what left and what waited: `received`, `forwarded`, `queue`, each (n,) bits.

    `queue` is q_n at the beginning of the slot.
    """

    received: Real
    forwarded: Real
    queue: Real

    @property
    def rate(self) -> float:
        """The delivered rate R_del, the mean of f_n, bit/s/Hz."""
        return float(self.forwarded.mean())


@dataclass(frozen=True, slots=True)
class RelayQueue:
    """How a relay forwards: sharing one band between both hops if `half`; its buffer, bit/Hz.

    In slots of `time_step` seconds the buffer is that of `buffer / time_step` bits per slot.
    """

    half: bool = False
    buffer: float = math.inf

    def best_shares(self, I_U: Real, I_G: Real, time_step: float) -> Real | None:
        """Return the best shares of receiving (n,) at rates (n,), None in full duplex."""
        return best_shares(I_U, I_G, self.buffer / time_step) if self.half else None

    def relayed(
        self, I_U: Real, I_G: Real, time_step: float, shares: Real | None = None
    ) -> Relayed:
        """Return what is delivered at rates (n,): greedily, with given or else the best shares.

        Of each slot a share is for receiving: its rates are that of I_U and the rest of I_G.
        """
        room = self.buffer / time_step
        if self.half:
            if shares is None:
                shares = best_shares(I_U, I_G, room)
            I_U, I_G = shares * I_U, (1 - shares) * I_G
        return forward_greedily(I_U, I_G, room)


def forward_greedily(I_U: Real, I_G: Real, buffer: float = math.inf) -> Relayed:
    """Return what a full-duplex relay delivers that sends what it holds as fast as it can.

    f_n = min(q_n, I_G,n) and r_n = min(I_U,n, buffer - q_n + f_n) for rates `I_U`, `I_G` (n,),
    bits, and a `buffer` of that many bits per hertz. No other forwarding along the same route
    delivers more: a bit that can leave now and waits only takes room. Raises `InputError` for
    rates of different shapes, negative or not finite ones, or a buffer not above 0.

    >>> relayed = forward_greedily(np.array([2.0, 1.0, 0.0]), np.array([5.0, 1.0, 1.5]))
    >>> relayed.queue.tolist(), relayed.forwarded.tolist()
    ([0.0, 2.0, 2.0], [0.0, 1.0, 1.5])
    """
    _check(I_U, I_G, buffer)
    received, forwarded, queue = np.empty((3, len(I_U)))
    waiting = 0.0
    for n, (arriving, leaving) in enumerate(zip(I_U.tolist(), I_G.tolist(), strict=True)):
        queue[n] = waiting
        forwarded[n] = min(waiting, leaving)
        received[n] = min(arriving, buffer - waiting + forwarded[n])
        waiting += received[n] - forwarded[n]
    return Relayed(received, forwarded, queue)


def best_shares(I_U: Real, I_G: Real, buffer: float = math.inf) -> Real:
    """Return the shares (n,) of the slots to receive in with which a route delivers most.

    Each slot brings the queue as near as it can to the level that is best for the slots after it:
    see `queue_levels`. Raises `InputError` as `forward_greedily` does.

    >>> best_shares(np.array([2.0, 2.0]), np.array([2.0, 2.0])).tolist()
    [1.0, 0.0]
    """
    _check(I_U, I_G, buffer)
    slots = I_U.tolist(), I_G.tolist()
    shares, waiting = [], 0.0
    for u, g, level in zip(*slots, queue_levels(*slots, buffer), strict=True):
        sending = 0.0
        if g > 0:
            sending = max(0.0, min(1.0, waiting / g, (waiting + u - level) / (u + g)))
        shares.append(1 - sending)
        waiting = max(0.0, min(buffer, waiting + (1 - sending) * u - sending * g))
    return np.array(shares)


def _check(I_U: Real, I_G: Real, buffer: float) -> None:
    if I_U.ndim != 1 or I_U.shape != I_G.shape or not len(I_U):
        raise InputError(f"rates {I_U.shape} and {I_G.shape}; expected one per slot of each hop")
    if not (np.isfinite(I_U).all() and np.isfinite(I_G).all() and min(I_U.min(), I_G.min()) >= 0):
        raise InputError("rates of a relay: expected finite bits of at least 0")
    if not buffer > 0:
        raise InputError(f"buffer {buffer}; expected bits per hertz above 0")


def queue_levels(I_U: Sequence[float], I_G: Sequence[float], buffer: float) -> list[float]:
    """Return the levels L_n (n,), bits, up to which a half-duplex relay fills its queue.

    For the rates of n slots, bits, a queue that begins empty and is never above `buffer`, by
    dynamic programming: 480 slots take 2 ms, 10,000 take 0.2 s. With q bits waiting at the
    beginning of slot n, what can still be delivered is V_n(q), and V_N = 0 after the last slot.
    With the share y of slot n for sending, y g_n <= q, it is

        V_n(q) = max_y y g_n + V_{n+1}(q + u_n - y (u_n + g_n))

    for rates u_n of receiving and g_n of sending. V is concave: the best y brings the queue as near
    as it can to the level at which one bit more is worth as much later as its time is worth now,

        V'_{n+1}(L_n) = s_n = g_n / (u_n + g_n).

    V' is a staircase. If L_n >= u_n, V'_n is V'_{n+1} without its first u_n bits and with
    u_n + g_n bits at s_n. Else all beyond L_n stays; before it come L_n (1 + g_n / u_n) bits at
    s_n; and first of all those from L_n to u_n once more, the last of them first, for fewer than
    g_n waiting bits limit y: V'_n = 1 - V'_{n+1} u_n / g_n there, on g_n / u_n times their length.

    >>> queue_levels([3.0, 2.0, 1.0], [1.0, 2.0, 3.0], float("inf"))
    [3.0, 3.0, 0.0]
    """
    worth, levels, reachable = _Staircase(), [], sum(I_U)
    for u, g in zip(reversed(I_U), reversed(I_G), strict=True):
        slope = g / (u + g) if g > 0 else 0.0
        at = bisect_right(worth.slopes, slope)
        level = sum(worth.bits[at:], 0.0)
        levels.append(level)
        if level >= u:
            worth.drop(u, -1)
            worth.insert(at, slope, u + g)
        else:
            again = worth.after(at, u - level) if g > 0 else []
            del worth.slopes[at:], worth.bits[at:]
            worth.insert(at, slope, level * (1 + g / u))
            for value, bits in again:
                worth.insert(len(worth.slopes), 1 - value * u / g, bits * g / u)
        reachable -= u
        worth.drop(sum(worth.bits) - min(buffer, reachable), 0)
    return levels[::-1]


@dataclass(frozen=True, slots=True, eq=False)
class _Staircase:
    """V' from its end, beyond which it is 0, to its beginning: `slopes`, ascending, for `bits`."""

    slopes: list[float] = field(default_factory=list)
    bits: list[float] = field(default_factory=list)

    def insert(self, at: int, slope: float, bits: float) -> None:
        """Put a stair before that which is `at`, in the order of this list."""
        at = min(at, len(self.slopes))
        if at > 0 and slope - self.slopes[at - 1] < _SAME:
            self.bits[at - 1] += bits
        else:
            self.slopes.insert(at, slope)
            self.bits.insert(at, bits)

    def drop(self, bits: float, end: int) -> None:
        """Take away the first `bits`, at the end -1 of this list, or the last, at its end 0."""
        while bits > 0 and self.bits:
            if self.bits[end] > bits:
                self.bits[end] -= bits
                return
            bits -= self.bits.pop(end)
            self.slopes.pop(end)

    def after(self, at: int, bits: float) -> list[tuple[float, float]]:
        """Return the stairs, slope and bits, of the `bits` that come after the stair `at`."""
        found = []
        while bits > 0 and at > 0:
            at -= 1
            found.append((self.slopes[at], min(bits, self.bits[at])))
            bits -= self.bits[at]
        return [*found, (0.0, bits)] if bits > 0 else found
