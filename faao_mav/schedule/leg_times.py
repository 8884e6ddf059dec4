"""How much longer legs take at other speeds, and what flights have told of it.

Constants that name no source are chosen; what a change costs is not measured.
"""

import numpy as np

from faao_mav.arrays import Real

# How far the time of a leg may be from its guess: standard deviations of what its own speed does,
# s for a change by the whole speed, and as a share of its cruise; of what the speed before it does;
# and of what else changes its duration, s.
_OWN, _OWN_SHARE, _ENTRY, _NOISE = 0.3, 0.3, 1.0, 0.1


class LegTimes:
    """How much longer each leg of a flight takes, s, when speeds v_k become v'_k.

    With q_k = v_k / v'_k - 1 leg k takes longer by (c_k + own_k) q_k + entry_k q_{k-1}. c_k, the
    cruise, is the time for which it is flown at its command. The corrections own_k and entry_k are
    0 at first, and found by a Kalman filter for each leg.

    >>> times, cruise = LegTimes(2), np.array([10.0, 20.0])
    >>> times.delays(cruise, np.array([0.1, 0.0]))
    array([1., 0.])
    >>> for _ in range(50):
    ...     times.learn(cruise, np.array([0.1, 0.0]), np.array([0.9, 0.2]))
    >>> times.delays(cruise, np.array([0.1, 0.0])).round(2)
    array([0.9, 0.2])
    """

    def __init__(self, legs: int) -> None:
        self._corrections = np.zeros((legs, 2))
        self._covariance: Real | None = None

    def slopes(self, cruise: Real) -> Real:
        """Return what the q of each leg does to the times of all, (m - 1, m - 1), s.

        `cruise` (m - 1,) is c_k, s.
        """
        own, entry = self._corrections.T
        return np.diag(cruise + own) + np.diag(entry[1:], -1)

    def delays(self, cruise: Real, q: Real) -> Real:
        """Return by how much longer the legs take, (m - 1,), s."""
        own, entry = self._corrections.T
        return (cruise + own) * q + entry * _before(q)

    def learn(self, cruise: Real, q: Real, longer: Real) -> None:
        """Take in that the legs took `longer` by so much, (m - 1,), s."""
        if self._covariance is None:
            own = _OWN**2 + (_OWN_SHARE * cruise) ** 2
            self._covariance = np.stack([own, np.full(len(own), _ENTRY**2)])[:, None].T * np.eye(2)
        row = np.stack([q, _before(q)], axis=-1)[:, :, None]
        told = self._covariance @ row
        weight = told / (row.swapaxes(1, 2) @ told + _NOISE**2)
        surprise = longer - self.delays(cruise, q)
        self._corrections += weight[:, :, 0] * surprise[:, None]
        self._covariance = self._covariance - weight @ told.swapaxes(1, 2)


def _before(q: Real) -> Real:
    """Return the q of the leg before each, 0 for the first."""
    return np.concatenate([[0.0], q[:-1]])
