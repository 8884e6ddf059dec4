"""A link with finite-alphabet inputs as a real channel y = s + z, z ~ N(0, I).

Only the noise within the span of H P u matters; the rest cancels in (5). The received points s have
as few real dimensions as H P leaves them.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Integers, Real, RealOrComplex
from faao_mav.errors import InputError
from faao_mav.radio.constellation import constellation, levels, symbol_vectors

MAX_INPUTS = 1 << 16
"""Input vectors accepted at most. Chosen: the time of a slot is proportional to their number."""


@dataclass(frozen=True, eq=False)
class RealInputs:
    """The M input vectors as real vectors, and those over which it is enough to average.

    `points` (M, D) are all of them in D real coordinates. `sent` (r,) are the rows of ``points`` to
    average over; the others contribute the same by symmetry. `choices` says how many symbols of
    each antenna occur in ``sent``, the last antenna running fastest; their product is r. `variance`
    is the mean square of each real coordinate, `bits` log2 M, bit per channel use. `levels` (L,)
    are the values of each coordinate where sums are formed by parts (``constellation.levels``).
    """

    points: Real
    sent: Integers
    choices: tuple[int, ...]
    variance: float
    bits: float
    levels: Real | None

    @property
    def part(self) -> "RealInputs | None":
        """One of the two parts of a single symbol, if they are independent; None for others."""
        if self.levels is None or self.points.shape[1] != 2:
            return None
        above = np.flatnonzero(self.levels > 0)  # those below contribute the same
        return RealInputs(
            self.levels[:, None], above, (len(above),), self.variance, self.bits / 2, None
        )


def real_inputs(modulation: str, antennas: int) -> RealInputs:
    """Return the input vectors x of (3) in real coordinates, [x] for BPSK and [Re x, Im x] else.

    Raises `InputError` for an unknown modulation or more than 65,536 input vectors.

    >>> inputs = real_inputs("qpsk", 1)
    >>> inputs.points.shape, inputs.sent.tolist(), inputs.bits
    ((4, 2), [3], 2.0)
    """
    symbols = constellation(modulation)
    size = len(symbols) ** antennas
    if size > MAX_INPUTS:
        raise InputError(
            f"{modulation} on {antennas} antennas has {size} input vectors; "
            f"the mutual information is computed for up to {MAX_INPUTS}"
        )
    x = symbol_vectors(modulation, antennas)
    # A rotation that maps the alphabet onto itself maps the noise onto equally likely noise:
    # vectors that differ by one contribute the same, and no vector is left fixed.
    if modulation == "bpsk":
        points, variance, keep = x.real, 1.0, symbols.real > 0.0
    else:
        points, variance = np.hstack([x.real, x.imag]), 0.5
        sector = 2.0 * np.pi / (8 if modulation == "8psk" else 4)
        angle = np.angle(symbols) % (2.0 * np.pi)
        keep = (angle + 1e-9) % (2.0 * np.pi) < sector
    # The first entry runs slowest in symbol_vectors.
    sent = np.flatnonzero(np.repeat(keep, size // len(symbols)))
    choices = (int(np.count_nonzero(keep)), *[len(symbols)] * (antennas - 1))
    return RealInputs(
        np.ascontiguousarray(points),
        sent,
        choices,
        variance,
        float(np.log2(size)),
        levels(modulation),
    )


def real_channel(H: RealOrComplex, P: RealOrComplex, noise: float, real: bool) -> tuple[Real, Real]:
    """Return the real channel s = x B that is equivalent to √2 H P x / σ, by its singular values.

    These are (n, d), largest first, and the maps B (n, D, d), for noise z ~ N(0, I). `H`
    (n, N_r, N_t) are channels, `P` (n, N_t, N_t) precoders, `noise` is σ², W; `real` says whether
    the alphabet is real, which leaves D = N_t coordinates instead of 2 N_t.

    >>> singular, maps = real_channel(np.eye(1)[None], np.eye(1)[None], 0.5, real=True)
    >>> float(singular[0, 0]), maps.shape
    (2.0, (1, 1, 1))
    """
    A = np.asarray(H) @ np.asarray(P) * np.sqrt(2.0 / noise)
    left = np.concatenate([A.real, A.imag], axis=-2)
    B = left if real else np.concatenate([left, np.concatenate([-A.imag, A.real], -2)], axis=-1)
    _, singular, right = np.linalg.svd(B, full_matrices=False)
    return singular, np.swapaxes(right, -1, -2) * singular[..., None, :]
