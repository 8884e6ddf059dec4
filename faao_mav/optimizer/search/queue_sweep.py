"""Dynamic programming over the cells of a map and the levels of the relay's queue.

What can be sent from an instant on is known for each cell and level, and between two levels in
proportion. Of all that the cells in reach have of the level that is left the best counts.
"""

from collections.abc import Iterator

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.search.sweep import Cells, Steps
from faao_mav.radio.relay import RelayQueue

_NOWHERE = -1e9
"""What is to be had where no flight can be: less than any bits."""

_SHARES = (0.0, 0.5, 1.0)
"""Shares of a step in which a half-duplex relay receives. Chosen."""

_LEAST = 1e-9
"""Bits of the queue's highest level at least: there are levels where nothing is received."""


class QueueSweep:
    """Best paths by place and level: `rates` (2, K, i, j) of both hops over `cells`, bits.

    They are those of all slots of an instant together; `steps` lead from cell to cell. There are so
    many even `levels`, bits per hertz and slot; below 0, for R_avg without a `relay`, more has been
    sent than was received.
    """

    def __init__(
        self,
        cells: Cells,
        rates: Real,
        levels: int,
        steps: Steps,
        relay: RelayQueue | None,
        time_step: float,
    ) -> None:
        self.cells, self.rates, self.steps = cells, rates, steps
        self.queued, self.half = relay is not None, relay is not None and relay.half
        come, gone = rates.max(axis=(2, 3)).sum(axis=1)
        most = come * gone / max(come + gone, _LEAST)  # what is received first and then sent
        most = max(_LEAST, min(most, np.inf if relay is None else relay.buffer / time_step))
        self.levels: Real = np.linspace(-most if relay is None else 0.0, most, levels)

    def path(self) -> Real:
        """Return the best path, the places (K, 2) at the instants, m."""
        ahead = [each.reshape(len(self.levels), -1) for each in self._backward()][::-1]
        level = np.zeros(1)
        places = [int(self._between(ahead[0], level).argmax())]
        for k, after in enumerate(ahead[1:]):
            here = places[-1]
            near = self.steps.ahead(here, self.cells.x.shape[1:])
            rates = self.rates[:, k].reshape(2, -1)[:, here, None]
            found = [
                (sent + self._between(after[:, near], left), left)
                for sent, left in self._after(level, *rates)
            ]
            best, level = max(found, key=lambda each: float(each[0].max()))
            places.append(int(near[best.argmax()]))
        return np.asarray(self.cells.x.reshape(2, -1)[:, places].T)

    def _backward(self) -> Iterator[Real]:
        """Yield what can be sent (L, i, j), by the level before, from the last instant back."""
        shape = len(self.levels), *self.cells.x.shape[1:]
        after = np.broadcast_to(np.minimum(0.0, self.levels)[:, None, None], shape)
        for k in range(len(self.cells.instants) - 1, -1, -1):
            options = self._after(self.levels[:, None, None], *self.rates[:, k])
            best = np.max([sent + self._between(after, left) for sent, left in options], axis=0)
            found = np.where(self.cells.alive[k], best, _NOWHERE)
            yield found
            after = self.steps.best(found)

    def _after(self, level: Real, I_U: Real, I_G: Real) -> Iterator[tuple[Real, Real]]:
        """Yield what is sent from a `level` on, and the level that is left."""
        for share in _SHARES if self.half else (None,):
            come, gone = (I_U, I_G) if share is None else (share * I_U, (1 - share) * I_G)
            sent = np.minimum(level + come, gone) if self.queued else gone + 0 * level
            yield sent, np.clip(level + come - sent, self.levels[0], self.levels[-1])

    def _between(self, values: Real, level: Real) -> Real:
        """Return the `values` (L, ...) at a `level` (..., or L, ...)."""
        at = (level - self.levels[0]) / (self.levels[1] - self.levels[0])
        low = np.minimum(at.astype(np.intp), len(self.levels) - 2)
        wide = low if low.ndim == values.ndim else low[None]
        below, above = (np.take_along_axis(values, wide + step, 0) for step in (0, 1))
        found = below + (at - low) * (above - below)
        return np.asarray(found if low.ndim == values.ndim else found[0])
