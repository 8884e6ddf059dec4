"""From the channel's own coordinates to the map: derivatives of a rate by the UAV's position.

A link's rate depends on the position w through two numbers only: the logarithm of the path gain,
l = ln(rho_0 / d²), and, where arrays turn with the UAV, the direction cosine u = (x - x_j) / d
along east. Rates deliver their derivatives by (l, u); the chain rule to w is the same for all.
Positions and gradients are (2, ..., n), Hessians (3, ..., n): xx, xy, yy.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.problem import Link


@dataclass(frozen=True, slots=True, eq=False)
class Turning:
    """Derivatives by u, and by l and u, of a rate that depends on the direction, bits (..., n)."""

    by_u: Real
    by_lu: Real
    by_uu: Real


@dataclass(frozen=True, slots=True, eq=False)
class Partials:
    """A rate per slot with its derivatives by l, bits (..., n), and those by u where it has any."""

    value: Real
    by_l: Real
    by_ll: Real
    turning: Turning | None = None


class PlaceRate(Protocol):
    """The rate of one link as a function of where the UAV is."""

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate of every slot, bits (..., n), at l and u (..., n)."""

    def partials(self, gain_log: Real, cosine: Real) -> Partials:
        """Return the rate and its derivatives at l and u (..., n)."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where the positions w are for a station: x, y and d² of w - p_j, l and u, (..., n)."""

    x: Real
    y: Real
    square: Real
    gain_log: Real
    cosine: Real

    def by_position(self, rate: Partials) -> tuple[Real, Real]:
        """Return gradient and Hessian of a rate by w, bits per m and per m²."""
        x, y = self.x, self.y
        # l_i = g x_i and l_ij = g δ_ij + l_i l_j with g = -2 / d²
        g = -2 / self.square
        l_x, l_y = g * x, g * y
        both, level = rate.by_l + rate.by_ll, g * rate.by_l
        gradient = np.stack([rate.by_l * l_x, rate.by_l * l_y])
        across = both * l_x
        hessian = np.stack([across * l_x + level, across * l_y, both * l_y * l_y + level])
        if rate.turning is None:
            return gradient, hessian
        at = rate.turning
        # u = x / d, with derivatives by way of r = 1 / d, r_i = -x_i r³
        r = 1 / np.sqrt(self.square)
        r3 = r / self.square
        r5 = 3 * r3 / self.square
        u_x, u_y = r - x * x * r3, -x * y * r3
        gradient += np.stack([at.by_u * u_x, at.by_u * u_y])
        bend = np.stack([x * (x * x * r5 - 3 * r3), y * (x * x * r5 - r3), x * (y * y * r5 - r3)])
        hessian += at.by_u * bend + at.by_uu * np.stack([u_x * u_x, u_x * u_y, u_y * u_y])
        crossed = np.stack([2 * l_x * u_x, l_x * u_y + l_y * u_x, 2 * l_y * u_y])
        hessian += at.by_lu * crossed
        return gradient, hessian


def place(link: Link, w: Real) -> Place:
    """Return where the positions w (2, ..., n) are for the station of `link`."""
    x, y = w[0] - link.station[0], w[1] - link.station[1]
    square = x * x + y * y + link.altitude**2
    return Place(x, y, square, np.log(link.reference_gain / square), x / np.sqrt(square))
