"""The channel of each hop: H = √(rho_0 d^-2) (√(K/(K+1)) H^LoS + √(1/(K+1)) H^NLoS), (1), (2).

The functions of this module are its factors: line of sight, scattering, and their sum. `gain` has
the path gain.
"""

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.errors import InputError


def line_of_sight_ula(cosine: Real, receive: int, transmit: int) -> Complex:
    """Return H^LoS of uniform linear arrays half a wavelength apart, both lying along east.

    Entry (l, m) of the result, (..., receive, transmit) and of rank one, is exp(-jπ (l - m) u):
    moving the receiving element east along the wave lengthens its way, moving the transmitting one
    shortens it. u (...), `cosine`, is the east component of the unit vector along the wave, from
    transmitter to receiver, which are far apart for such arrays. The phase common to all entries,
    2π d/λ, changes no rate and is left out. `receive` and `transmit` are numbers of antennas.

    >>> np.round(line_of_sight_ula(np.array(1.0), 2, 2), 12).real
    array([[ 1., -1.],
           [-1.,  1.]])
    """
    steps = np.arange(receive)[:, None] - np.arange(transmit)
    return np.asarray(np.exp(-1j * np.pi * steps * cosine[..., None, None]))


def rayleigh(rng: np.random.Generator, slots: int, receive: int, transmit: int) -> Complex:
    """Return draws from `rng` of H^NLoS, (slots, receive, transmit), independent CN(0, 1) each.

    >>> rayleigh(np.random.default_rng(1), 3, 2, 4).shape
    (3, 2, 4)
    """
    parts = rng.standard_normal((2, slots, receive, transmit))
    drawn: Complex = (parts[0] + 1j * parts[1]) * np.sqrt(0.5)
    return drawn


def balanced_rayleigh(rng: np.random.Generator, draws: int, receive: int, transmit: int) -> Complex:
    """Return a few draws of H^NLoS from `rng` that represent CN(0, 1), (draws, receive, transmit).

    Every draw comes with its rotations by j, -1 and -j, and all are scaled to unit mean power: the
    sample mean 0 and the sample mean square 1 are exact. Fewer than four draws are only scaled.

    >>> G = balanced_rayleigh(np.random.default_rng(1), 8, 2, 2)
    >>> bool(np.abs(G.mean(axis=0)).max() < 1e-15), float(np.mean(np.abs(G) ** 2).round(12))
    (True, 1.0)
    """
    rotations = 4 if draws >= 4 else 1
    base = rayleigh(rng, -(-draws // rotations), receive, transmit)
    drawn = np.concatenate([base * 1j**k for k in range(rotations)])[:draws]
    return np.asarray(drawn / np.sqrt(np.mean(np.abs(drawn) ** 2)))


def rician(los: RealOrComplex, nlos: RealOrComplex, K: float) -> Complex:
    """Return √(K/(K+1)) H^LoS + √(1/(K+1)) H^NLoS, the bracket of (1) and (2), (..., N_r, N_t).

    `los` and `nlos` (..., N_r, N_t) are the line-of-sight and the scattered part, whose leading
    axes broadcast; both of unit mean power per entry, as is the result. `K` is the Rician factor,
    linear; infinity gives the line of sight alone. Raises `InputError` for a K below 0 or NaN.

    >>> rician(np.ones((1, 1)), np.zeros((1, 1)), 3.0).round(6)
    array([[0.866025]])
    """
    if not K >= 0.0:
        raise InputError(f"the Rician factor K must be at least 0, got {K}")
    scattered = 1.0 / (1.0 + K)
    return np.asarray(np.sqrt(1.0 - scattered) * los + np.sqrt(scattered) * nlos)
