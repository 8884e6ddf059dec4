"""The rate of a link as a function of the UAV's position: the rate models.

A rate model answers, for one link and all slots at once, what R_n of (7) or (8) is at the position
w_n, with first and second derivatives. A link's rate depends on w through two numbers only:

- l = ln(rho_0 / d²), the logarithm of the path gain of (1) or (2), d² = ||w - p||² + H²;
- u = (x - x_p) / d, the direction cosine along east, where the antenna arrays are rotated by it
  (``radio.line_of_sight: ula``).

A rate model (``RateModel``) therefore works with l and u, and ``LinkCoordinates`` carries its
derivatives over to w by the chain rule; ``field.RateField`` puts both links together. There are
three models:

====================  ==================================  =========================================
model                 fading, precoders                   method
====================  ==================================  =========================================
``TableRate``         none or averaged over; known per    spline over l + shift and a second
                      slot, best precoders, two modes     coordinate, tables are kept
                      at most
``SlotRate``          known per slot, more modes, or a    the precoders of every slot; envelope
                      classical scheme                    theorem, or central differences
``FixedRate``         given precoders                     exact slopes, differences of these
====================  ==================================  =========================================

To change which model a plan gets, or to add one: write a class with ``value`` and ``partials`` and
return it from ``field.rate_models``, the only place that chooses. What counts as the rate (cutoff
rate, mutual information) is ``radio.rate``; Gaussian inputs and how precoders follow a channel are
``optimizer.design``.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.problem import Link


@dataclass(frozen=True, slots=True, eq=False)
class DirectionPartials:
    """The derivatives R_u, R_lu and R_uu of a rate that depends on u, bits (..., n)."""

    by_u: Real
    by_lu: Real
    by_uu: Real


@dataclass(frozen=True, slots=True, eq=False)
class RatePartials:
    """The rate R of every slot with R_l and R_ll, bits (..., n); `direction` if R depends on u."""

    value: Real
    by_l: Real
    by_ll: Real
    direction: DirectionPartials | None = None


class RateModel(Protocol):
    """The rate of one link as a function of l and u, both (..., n)."""

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (..., n)."""

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its derivatives, bits (..., n)."""

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex | None:
        """Return precoders ((S,) n, N_t, N_t) close to the best at l and u (n,), if known."""


@dataclass(frozen=True, slots=True, eq=False)
class LinkCoordinates:
    """The positions w as one station sees them, (..., n) each.

    `east` and `north` are w - p in metres, `squared_distance` is d² in m², `gain_log` is l and
    `cosine` is u.
    """

    east: Real
    north: Real
    squared_distance: Real
    gain_log: Real
    cosine: Real

    def by_position(self, rate: RatePartials) -> tuple[Real, Real]:
        """Return gradient and Hessian of a rate by w.

        Returns:
            R_x, R_y (2, ..., n), bits per metre, and R_xx, R_xy, R_yy (3, ..., n), bits per m².
        """
        x, y = self.east, self.north
        # l_i = g x_i and l_ij = g δ_ij + l_i l_j with g = -2 / d²
        g = -2 / self.squared_distance
        l_x, l_y = g * x, g * y
        both, level = rate.by_l + rate.by_ll, g * rate.by_l
        gradient = np.stack([rate.by_l * l_x, rate.by_l * l_y])
        across = both * l_x
        hessian = np.stack([across * l_x + level, across * l_y, both * l_y * l_y + level])
        if rate.direction is None:
            return gradient, hessian
        at = rate.direction
        # u = x / d, with derivatives by way of r = 1 / d, r_i = -x_i r³
        r = 1 / np.sqrt(self.squared_distance)
        r3 = r / self.squared_distance
        r5 = 3 * r3 / self.squared_distance
        u_x, u_y = r - x * x * r3, -x * y * r3
        gradient += np.stack([at.by_u * u_x, at.by_u * u_y])
        u_ij = np.stack([x * (x * x * r5 - 3 * r3), y * (x * x * r5 - r3), x * (y * y * r5 - r3)])
        hessian += at.by_u * u_ij + at.by_uu * np.stack([u_x * u_x, u_x * u_y, u_y * u_y])
        crossed = np.stack([2 * l_x * u_x, l_x * u_y + l_y * u_x, 2 * l_y * u_y])
        hessian += at.by_lu * crossed
        return gradient, hessian


def link_coordinates(link: Link, w: Real) -> LinkCoordinates:
    """Return the coordinates of the positions w (2, ..., n), m, for the station of `link`."""
    east, north = w[0] - link.station[0], w[1] - link.station[1]
    squared_distance = east * east + north * north + link.altitude**2
    gain_log = np.log(link.reference_gain / squared_distance)
    return LinkCoordinates(
        east, north, squared_distance, gain_log, east / np.sqrt(squared_distance)
    )
