"""The rate that counts, by name: the cutoff rate (7), (8) or the mutual information (5), (6).

Each goes with the precoders that maximise it. The cutoff rate is what is known of every code; the
mutual information what the best codes come near to.
"""

from typing import Literal, TypeAlias

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.radio.best_precoder import best_mean_precoders
from faao_mav.radio.constellation import difference_classes
from faao_mav.radio.information_precoder import best_information_precoders
from faao_mav.radio.mutual_information import mutual_information
from faao_mav.radio.rate import cutoff_rate

Measure: TypeAlias = Literal["cutoff", "mutual_information"]


def draw_rates(
    measure: Measure, H: RealOrComplex, P: RealOrComplex, modulation: str, noise: float
) -> Real:
    """Return the rate of every draw of a channel, (..., S) bit/s/Hz.

    Of the mutual information the mean over the S draws is accurate. Arguments and errors are those
    of ``mutual_information``.

    >>> one = np.ones((1, 1, 1))
    >>> for measure in ("cutoff", "mutual_information"):
    ...     print(draw_rates(measure, one, one, "bpsk", 1.0).round(3))
    [0.548]
    [0.721]
    """
    if measure == "mutual_information":
        return mutual_information(H, P, modulation, noise)
    return cutoff_rate(H, P, difference_classes(modulation, np.shape(P)[-1]), noise)


def best_precoders_for(
    measure: Measure,
    H: RealOrComplex,
    power: float,
    modulation: str,
    noise: float,
    *,
    start: RealOrComplex | None = None,
) -> Complex:
    """Return the precoder (..., N_t, N_t) of highest mean rate over the draws H (..., S, N_r, N_t).

    The search begins at `start` (..., N_t, N_t) where given. Arguments and errors are those of
    ``best_mean_precoders``.
    """
    if measure == "mutual_information":
        return best_information_precoders(H, power, modulation, noise, start=start)
    return best_mean_precoders(H, power, modulation, noise, start=start).P
