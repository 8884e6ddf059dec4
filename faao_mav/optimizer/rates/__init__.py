"""The rate of a link as a function of the UAV's position: the rate models.

A rate model answers, for one link and all slots at once, what R_n of (7) or (8) is at the position
w_n, with first and second derivatives. A link's rate depends on w through two numbers only:

- l, the logarithm of the path gain (``radio.gain``), a function of d² = ||w - p||² + H²: in the
  paper ln(rho_0 / d²);
- u = (x - x_p) / d, the direction cosine along east, where the antenna arrays are rotated by it
  (``radio.line_of_sight: ula``).

A rate model (``RateModel``) therefore works with l and u, and ``by_position`` carries its
derivatives over to w by the chain rule; ``field.RateField`` puts both links together. There are
two, and ``field.rate_field`` is the only place that chooses: ``TableRate``, a spline over l +
shift and a second coordinate, for fading that is none, averaged over, or known per slot with best
precoders in two modes at most; and else ``SlotRate``, the precoders of every slot, with central
differences. What counts as the rate (cutoff rate, mutual information) is ``radio.rate``; Gaussian
inputs and how precoders follow a channel are ``optimizer.design``.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import Complex, Real, products
from faao_mav.optimizer.design import Link


@dataclass(frozen=True, slots=True, eq=False)
class RatePartials:
    """The rate R of every slot with R_l and R_ll, bits (..., n).

    `by_u`, `by_lu` and `by_uu` are R_u, R_lu and R_uu of a rate that depends on u, else None.
    """

    value: Real
    by_l: Real
    by_ll: Real
    by_u: Real | None = None
    by_lu: Real | None = None
    by_uu: Real | None = None


class RateModel(Protocol):
    """The rate of one link as a function of l and u, both (..., n)."""

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (..., n)."""

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its derivatives, bits (..., n)."""

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex | None:
        """Return precoders ((S,) n, N_t, N_t) close to the best at l and u (n,), if known."""


def link_coordinates(link: Link, w: Real) -> tuple[Real, Real]:
    """Return l and u (..., n) of the positions w (2, ..., n), m, for the station of `link`."""
    away = link.gains.away(w)
    return link.gains.log(w), away[0] / np.sqrt(link.gains.squared_distance(away))


def by_position(link: Link, w: Real, rate: RatePartials) -> tuple[Real, Real]:
    """Return gradient and Hessian of a `rate` of `link` by the positions w (2, ..., n).

    That is R_x, R_y (2, ..., n), bits per metre, and R_xx, R_xy, R_yy (3, ..., n), bits per m².
    """
    l_i, l_ij = link.gains.slopes(w)
    gradient = rate.by_l * l_i
    hessian = rate.by_l * l_ij + rate.by_ll * products(l_i, l_i)
    if rate.by_u is not None and rate.by_lu is not None and rate.by_uu is not None:
        x, y = away = link.gains.away(w)
        r = 1 / np.sqrt(link.gains.squared_distance(away))
        r3, r5 = r**3, 3 * r**5
        u_i = np.stack([r - x * x * r3, -x * y * r3])
        u_xx, u_xy, u_yy = x * (x * x * r5 - 3 * r3), y * (x * x * r5 - r3), x * (y * y * r5 - r3)
        gradient += rate.by_u * u_i
        hessian += rate.by_u * np.stack([u_xx, u_xy, u_yy]) + rate.by_uu * products(u_i, u_i)
        hessian += 2 * rate.by_lu * products(l_i, u_i)
    return gradient, hessian
