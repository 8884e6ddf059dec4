"""The rates that a radio has: steps over the SNR, in place of those of an alphabet.

One stream is sent along the channel's best mode, and has the highest step whose least SNR is
reached. The optimiser sees steps that rise over some decibels; what is priced are the steps.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from faao_mav.arrays import Complex, Integers, Real, RealOrComplex


class StreamRate(ABC):
    """The rate of one stream over its SNR: one's own is a subclass with `most` and `value`.

    `most` is the highest rate, bit/s/Hz. `width`, dB, is over how much of the SNR it changes
    noticeably, which the tables of the optimiser heed. Those with steps are `RateSteps`.

    >>> class Half(StreamRate):
    ...     most = 4.0
    ...     def value(self, snr):
    ...         return np.minimum(0.5 * np.log2(1.0 + snr), self.most)
    >>> Half().value(np.array([3.0, 15.0])).tolist()
    [1.0, 2.0]
    """

    width: float = 4.0

    @property
    @abstractmethod
    def most(self) -> float:
        """The highest rate, bit/s/Hz."""

    @abstractmethod
    def value(self, snr: Real) -> Real:
        """Return the rate at an SNR (...), linear, bit/s/Hz: smooth, and nowhere falling."""

    def number(self, snr: Real) -> Integers:
        """Return which step an SNR (...), linear, has: 1 is the lowest, 0 none."""
        return np.zeros(np.shape(snr), dtype=np.int_)

    def widened(self, width: float, *, above: bool = False) -> Self:  # noqa: ARG002
        """Return it as it is seen with steps that rise over `width` dB."""
        return self


@dataclass(frozen=True)
class RateSteps(StreamRate):
    """From an SNR of `snr_db[k]` on, `rates[k]` bit/s/Hz, both rising.

    With a `width`, dB, each step rises over so much about its SNR, twice continuously
    differentiable; over a sweep of the SNR the mean rate is that of the steps.

    >>> steps = RateSteps.of([9.0, 3.0, 5.0], [2.0, 1.0, 0.5])
    >>> steps.snr_db, steps.value(np.array([1.0, 2.0, 10.0])).tolist()
    ((3.0, 9.0), [0.0, 1.0, 2.0])
    """

    snr_db: tuple[float, ...]
    rates: tuple[float, ...]
    width: float = 0.0

    @classmethod
    def of(cls, snr_db: Sequence[float], rates: Sequence[float]) -> "RateSteps":
        """Return the steps of rows in any order; one that no lower SNR falls behind is left out."""
        kept: list[tuple[float, float]] = []
        for snr, rate in sorted(zip(snr_db, rates, strict=True), key=lambda row: (row[0], -row[1])):
            if rate > (kept[-1][1] if kept else 0.0):
                kept.append((snr, rate))
        return cls(tuple(snr for snr, _ in kept), tuple(rate for _, rate in kept))

    @property
    def most(self) -> float:
        """The highest rate, bit/s/Hz."""
        return self.rates[-1]

    def widened(self, width: float, *, above: bool = False) -> Self:
        """Return steps that rise over `width` dB, or so much earlier: nowhere below these."""
        snr_db = tuple(snr - above * width / 2 for snr in self.snr_db)
        return replace(self, snr_db=snr_db, width=width)

    def number(self, snr: Real) -> Integers:
        """Return which step an SNR (...), linear, has: 1 is the lowest, 0 none."""
        return np.searchsorted(self.snr_db, _db(snr), side="right")

    def value(self, snr: Real) -> Real:
        """Return the rate at an SNR (...), linear, bit/s/Hz."""
        if not self.width:
            return np.array([0.0, *self.rates])[self.number(snr)]
        x, total = _db(snr), np.zeros(np.shape(snr))
        for least, rise in zip(self.snr_db, np.diff(self.rates, prepend=0.0), strict=True):
            t = np.clip((x - least) / self.width + 0.5, 0.0, 1.0)
            total += rise * t**3 * (10 - 15 * t + 6 * t**2)
        return total


def _db(snr: Real) -> Real:
    return 10 * np.log10(np.maximum(snr, np.finfo(np.float64).tiny))


def one_stream(draws: RealOrComplex, power: float) -> Complex:
    """Return the precoder (..., N_t, N_t) of power W that sends one stream along the best mode.

    `draws` (..., S, N_r, N_t) are channels that it serves together: the mode is that of the highest
    mean gain. The stream is in the first column.

    >>> one_stream(np.diag([1.0, 2.0])[None], 9.0).real.round(9).tolist()
    [[0.0, 0.0], [3.0, 0.0]]
    """
    H = np.asarray(draws, dtype=np.complex128)
    mode = np.linalg.eigh((H.conj().mT @ H).mean(axis=-3))[1][..., -1]
    largest = np.take_along_axis(mode, np.abs(mode).argmax(axis=-1, keepdims=True), axis=-1)
    P = np.zeros((*mode.shape, mode.shape[-1]), dtype=np.complex128)
    P[..., 0] = np.sqrt(power) * mode * (np.abs(largest) / largest)
    return P
