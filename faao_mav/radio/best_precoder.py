"""Precoders that maximise the cutoff rate, (7) or (8), subject to tr(P^H P) <= W.

The limit is always active, and P_B(n) and P_U(n) of (14) separate: every slot is a problem of its
own. With H = U S V^H and P = V Q the rate depends on S Q alone, so that the search knows singular
values only; one P for many draws of a channel has no such reduction.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InputError
from faao_mav.radio.constellation import DifferenceClasses, difference_classes
from faao_mav.radio.precoder import (
    _check_positive,
    _with_power,
    bpsk_two_antennas,
    mmse,
    mrt,
    waterfilling,
    zf,
)
from faao_mav.radio.precoder_objective import ClassSum, value
from faao_mav.radio.precoder_search import search
from faao_mav.radio.rate import cutoff_rate

# Numbers held at once while the derivatives are assembled, 20 starts at a time: 32 MB.
_CHUNK = 4_000_000


@dataclass(frozen=True, eq=False)
class BestPrecoders:
    """Precoders and, on demand, what they reach.

    Attributes:
        P: (..., N_t, N_t), tr(P^H P) = W.
        exact: a closed form was used and the optimum is global; else the best of the starts.
        draws: (..., S, N_r, N_t), the channels that each P serves.
        classes: the differences of the alphabet.
        noise: σ², W.
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

    @cached_property
    def log_sum(self) -> Real:
        """(...) s with N log2(rho) - R_0 = log2(1 + e^s), see ``log_nonzero_sum``.

        It still tells precoders apart where R_0 equals N log2(rho) to the last digit.
        """
        S, receive, N = self.draws.shape[-3:]
        flat, P = self.draws.reshape(-1, S, receive, N), self.P.reshape(-1, 1, N, N)
        sums, found = ClassSum(self.classes), np.empty(len(flat))
        step = max(1, _CHUNK // (S * N * max(N, receive)))
        for first in range(0, len(flat), step):
            part = slice(first, first + step)
            HP = flat[part] @ P[part] / (2.0 * np.sqrt(self.noise))
            gram = np.conj(np.swapaxes(HP, -1, -2)) @ HP
            F = value(sums, gram, np.broadcast_to(np.eye(N), (len(HP), N, N)))
            # δ = ln(1 + e^s), where s is ln δ to the last digit once δ is that small.
            with np.errstate(divide="ignore"):
                found[part] = np.where(F < -36.0, F, np.log(np.expm1(np.exp(F))))
        return found.reshape(self.P.shape[:-2])


def _checked(H: Complex, axes: int, power: float, noise: float, start: Complex | None) -> Complex:
    _check_positive("transmit power", power)
    _check_positive("noise power", noise)
    H = np.asarray(H, dtype=np.complex128)
    if H.ndim < axes or 0 in H.shape[-axes:] or not np.all(np.isfinite(H)):
        raise InputError(f"channels must be finite with at least {axes} axes, got {H.shape}")
    expected = (*H.shape[:-axes], H.shape[-1], H.shape[-1])
    if start is not None and (np.shape(start) != expected or not np.all(np.isfinite(start))):
        raise InputError(f"the start must be finite and {expected}, got {np.shape(start)}")
    return H


def _best(
    H: Complex,
    power: float,
    modulation: str,
    noise: float,
    start: Complex | None,
    tolerance: float,
) -> BestPrecoders:
    """``best_mean_precoders`` with its arguments checked."""
    shape, (S, receive, N) = H.shape[:-3], H.shape[-3:]
    flat = H.reshape(-1, S, receive, N)
    classes = difference_classes(modulation, N)
    exact = N == 1 or (S == 1 and N == 2 and modulation == "bpsk")
    P = np.ones((len(flat), N, N), dtype=np.complex128)
    if exact and N == 2:
        P = bpsk_two_antennas(flat[:, 0], power)
    elif not exact:
        A = flat * (np.sqrt(power) / (2.0 * np.sqrt(noise)))
        given = None if start is None else np.asarray(start).reshape(-1, N, N)
        mean = np.mean(flat, axis=1)
        step = max(1, _CHUNK // (S * 2 * N**4 * (20 if start is None else 1)))
        for first in range(0, len(flat), step):
            part = slice(first, first + step)
            known = None if given is not None else _known(mean[part], power, noise)
            begin = None if given is None else given[part]
            P[part], _ = search(A[part], classes, tolerance, begin, known)
    P = _with_power(P, power)
    return BestPrecoders(P.reshape(*shape, N, N), exact, H, classes, noise)


def _known(H: Complex, power: float, noise: float) -> Complex:
    identity = np.broadcast_to(np.eye(H.shape[-1]), (*H.shape[:-2], H.shape[-1], H.shape[-1]))
    schemes = (mrt(H, power), zf(H, power), mmse(H, power, noise), waterfilling(H, power, noise))
    return np.stack([identity, *schemes])


def best_precoders(
    H: Complex,
    power: float,
    modulation: str,
    noise: float,
    *,
    start: Complex | None = None,
    tolerance: float = 1e-6,
) -> BestPrecoders:
    """Return the precoders of highest cutoff rate, max R_0(H, P) of (7) or (8) per slot.

    BPSK on two antennas and any alphabet on one have a closed form. Elsewhere Newton's method runs
    from several starts; the result is never below the classical schemes of ``precoder``.

    Args:
        H: (..., N_r, N_t) channels, one problem each.
        power: W, W.
        modulation: the alphabet, one of ``MODULATIONS``.
        noise: σ², W.
        start: (..., N_t, N_t), precoders of similar channels, of any power. The search then begins
            there only: far quicker, and not worse than the start scaled to W.
        tolerance: how far from a stationary point to stop, as a relative change of the power.

    Returns:
        The precoders, their rates and whether they are known to be optimal.

    Raises:
        InputError: W or σ² is not above 0, H or the start is not finite or has the wrong shape, or
            the modulation is unknown.

    >>> H = np.array([[2.0, 1.0], [1.0, 1.0]]) * np.sqrt(0.5)
    >>> float(best_precoders(H, 2.0, "qpsk", 1.0).rate.round(4))
    2.2761
    """
    H = _checked(H, 2, power, noise, start)
    return _best(H[..., None, :, :], power, modulation, noise, start, tolerance)


def best_mean_precoders(
    H_draws: Complex,
    power: float,
    modulation: str,
    noise: float,
    *,
    start: Complex | None = None,
    tolerance: float = 1e-6,
) -> BestPrecoders:
    """Return one precoder per group of draws, max over P of mean_s R_0(H_s, P), (7) or (8).

    It is what to send when the statistics of the fading are known and the fading is not. The mean
    is that of the rates; ``log_sum`` belongs to the mean rate.

    Args:
        H_draws: (..., S, N_r, N_t), S draws of each channel.
        power: W, W.
        modulation: the alphabet, one of ``MODULATIONS``.
        noise: σ², W.
        start: (..., N_t, N_t), as in ``best_precoders``.
        tolerance: as in ``best_precoders``.

    Returns:
        The precoders, (..., N_t, N_t), and their mean rates.

    Raises:
        InputError: as in ``best_precoders``.

    >>> draws = np.array([[[2.0, 1.0], [1.0, 1.0]], [[2.0, -1.0], [1.0, 1.0]]])
    >>> best_mean_precoders(draws, 2.0, "qpsk", 1.0).P.shape
    (2, 2)
    """
    H = _checked(H_draws, 3, power, noise, start)
    return _best(H, power, modulation, noise, start, tolerance)
