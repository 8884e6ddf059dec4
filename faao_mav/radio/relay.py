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
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.radio.queue_levels import queue_levels


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
