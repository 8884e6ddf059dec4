"""Precoders that maximise the cutoff rate, (7) or (8), subject to tr(P^H P) <= W.

The power limit is always active, and P_B(n) and P_U(n) of (14) separate: every slot of every link
is a problem of its own. With H = U S V^H and P = V Q the rate depends on S Q alone, so that the
best rate is a function of the singular values S. One P for many draws of a channel has no such
reduction.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.errors import InputError
from faao_mav.radio.constellation import DifferenceClasses, difference_classes
from faao_mav.radio.precoder import bpsk_two_antennas, check_positive, with_power
from faao_mav.radio.precoder_search import search
from faao_mav.radio.rate import cutoff_rate

_CHUNK = 4_000_000  # numbers held at once while the derivatives are assembled: 32 MB. Chosen
_STARTS = 20  # points from which each search starts, about, to reckon its memory with


@dataclass(frozen=True, eq=False)
class BestPrecoders:
    """Precoders of highest cutoff rate and, when asked for, that rate.

    `P` (..., N_t, N_t) has tr(P^H P) = W. `exact` says whether it is the global optimum, by a
    closed form; otherwise it is the best of the local optima that the search reached. `draws`
    (..., S, N_r, N_t) are the channels that each P serves, `classes` the differences of the
    alphabet, `noise` is σ², W.
    """

    P: Complex
    exact: bool
    draws: Complex
    classes: DifferenceClasses
    noise: float

    @cached_property
    def rate(self) -> Real:
        """(...) the cutoff rate R_0, bit/s/Hz; its mean where P serves many draws."""
        each = cutoff_rate(self.draws, self.P[..., None, :, :], self.classes, self.noise)
        return np.asarray(np.mean(each, axis=-1))


def has_closed_form(modulation: str, antennas: int) -> bool:
    """Return whether the best precoder for one channel has a closed form.

    >>> has_closed_form("bpsk", 2), has_closed_form("qpsk", 2), has_closed_form("64qam", 1)
    (True, False, True)
    """
    return antennas == 1 or (antennas == 2 and modulation == "bpsk")


def _checked(
    H: RealOrComplex, axes: int, power: float, noise: float, start: RealOrComplex | None
) -> Complex:
    """Return H (..., N_r, N_t) as complex numbers; the errors are those of ``best_precoders``."""
    check_positive("transmit power", power)
    check_positive("noise power", noise)
    H = np.asarray(H, dtype=np.complex128)
    if H.ndim < axes or 0 in H.shape[-axes:] or not np.all(np.isfinite(H)):
        raise InputError(f"channels must be finite with at least {axes} axes, got {H.shape}")
    expected = (*H.shape[:-axes], H.shape[-1], H.shape[-1])
    if start is not None and (np.shape(start) != expected or not np.all(np.isfinite(start))):
        raise InputError(f"the start must be finite and {expected}, got {np.shape(start)}")
    return H


def best_precoders(
    H: RealOrComplex,
    power: float,
    modulation: str,
    noise: float,
    *,
    start: RealOrComplex | None = None,
    tolerance: float = 1e-6,
) -> BestPrecoders:
    """Return the precoders of highest cutoff rate, max R_0(H, P) of (7) or (8) per slot.

    BPSK on two antennas and any alphabet on one have a closed form. For the others Newton's method
    runs from several starts, to the `tolerance`.

    Args:
        H: (..., N_r, N_t) channels, one problem each.
        power: W, W.
        modulation: the alphabet, one of ``MODULATIONS``.
        noise: σ², W.
        start: (..., N_t, N_t), precoders of similar channels, of any power. The search then starts
            there only, which is far quicker, and its result is not worse than the start scaled to
            W.
        tolerance: largest gain of a further step, as the relative change of W with the same gain.

    Raises:
        InputError: W or σ² is not above 0, H or the start is not finite or has the wrong shape, or
            the modulation is unknown.

    >>> H = np.array([[2.0, 1.0], [1.0, 1.0]]) * np.sqrt(0.5)
    >>> float(best_precoders(H, 2.0, "qpsk", 1.0).rate.round(4))
    2.2761
    """
    H = _checked(H, 2, power, noise, start)[..., None, :, :]
    return best_mean_precoders(H, power, modulation, noise, start=start, tolerance=tolerance)


def best_mean_precoders(
    H_draws: RealOrComplex,
    power: float,
    modulation: str,
    noise: float,
    *,
    start: RealOrComplex | None = None,
    tolerance: float = 1e-6,
) -> BestPrecoders:
    """Return one precoder per group of draws, max over P of mean_s R_0(H_s, P), (7) or (8).

    This is the best precoder for a transmitter that knows the statistics of the fading and not the
    draw (statistical CSI). `H_draws` (..., S, N_r, N_t) are S draws of each channel; the other
    arguments and the errors are those of ``best_precoders``.

    >>> draws = np.array([[[2.0, 1.0], [1.0, 1.0]], [[2.0, -1.0], [1.0, 1.0]]])
    >>> best_mean_precoders(draws, 2.0, "qpsk", 1.0).P.shape
    (2, 2)
    """
    H = _checked(H_draws, 3, power, noise, start)
    shape, (S, receive, N) = H.shape[:-3], H.shape[-3:]
    flat = H.reshape(-1, S, receive, N)
    classes = difference_classes(modulation, N)
    exact = N == 1 or (S == 1 and has_closed_form(modulation, N))
    P = np.ones((len(flat), N, N), dtype=np.complex128)
    if exact and N == 2:
        P = bpsk_two_antennas(flat[:, 0], power)
    elif not exact:
        scale = np.sqrt(power) / (2.0 * np.sqrt(noise))
        given = None if start is None else np.reshape(start, (-1, N, N)).astype(np.complex128)
        step = max(1, _CHUNK // (S * 2 * N**4 * (_STARTS if start is None else 1)))
        for first in range(0, len(flat), step):
            part = slice(first, first + step)
            begin = None if given is None else given[part]
            P[part] = search(flat[part] * scale, classes, tolerance, begin)
    P = with_power(P, power)
    return BestPrecoders(P.reshape(*shape, N, N), exact, H, classes, noise)
