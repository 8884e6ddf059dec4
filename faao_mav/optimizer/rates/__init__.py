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

from typing import Protocol

import numpy as np

from faao_mav.arrays import Complex, Real, products
from faao_mav.optimizer.design import Link
from faao_mav.optimizer.interior.rewards import StageValues


class RateModel(Protocol):
    """The rate of one link as a function of l and u, both (..., n)."""

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (..., n)."""

    def partials(self, gain_log: Real, cosine: Real) -> StageValues:
        """Return the rate R, bits (..., n), with R_l, R_u (2, ..., n) and R_ll, R_lu, R_uu.

        Of a rate that does not depend on u it is R_l and R_ll alone, (1, ..., n).
        """

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex | None:
        """Return precoders ((S,) n, N_t, N_t) close to the best at l and u (n,), if known."""


def link_coordinates(link: Link, w: Real) -> tuple[Real, Real]:
    """Return l and u (..., n) of the positions w (2, ..., n), m, for the station of `link`."""
    away = link.gains.away(w)
    return link.gains.log(w), away[0] / np.sqrt(link.gains.squared_distance(away))


def by_position(link: Link, w: Real, rate: StageValues) -> StageValues:
    """Return a `rate` by l and u of `link` as one by the positions w (2, ..., n).

    That is with R_x, R_y (2, ..., n), bits per metre, and R_xx, R_xy, R_yy (3, ..., n), bits per
    m².
    """
    (l_i, l_ij), by_l = link.gains.slopes(w), rate.gradient[0]
    gradient = by_l * l_i
    hessian = by_l * l_ij + rate.hessian[0] * products(l_i, l_i)
    if len(rate.gradient) > 1:
        x, y = away = link.gains.away(w)
        r = 1 / np.sqrt(link.gains.squared_distance(away))
        r3, r5 = r**3, 3 * r**5
        u_i = np.stack([r - x * x * r3, -x * y * r3])
        u_xx, u_xy, u_yy = x * (x * x * r5 - 3 * r3), y * (x * x * r5 - r3), x * (y * y * r5 - r3)
        by_u, (_, by_lu, by_uu) = rate.gradient[1], rate.hessian
        gradient += by_u * u_i
        hessian += by_u * np.stack([u_xx, u_xy, u_yy]) + by_uu * products(u_i, u_i)
        hessian += 2 * by_lu * products(l_i, u_i)
    return StageValues(rate.value, gradient, hessian)
