"""From the channel's own coordinates to the map: derivatives of a rate by the UAV's position.

A link's rate depends on the position w through two numbers only: the logarithm of the path gain,
l = ln(rho_0 / d²), and, where arrays turn with the UAV, the direction cosine u = (x - x_j) / d
along east. Rates deliver their derivatives by (l, u); the chain rule to w is the same for all.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import Real
from faao_mav.faao.problem import Link


@dataclass(frozen=True, slots=True, eq=False)
class Partials:
    """A rate per slot with its derivatives by l and u, bits, each (n,)."""

    value: Real
    by_l: Real
    by_u: Real
    by_ll: Real
    by_lu: Real
    by_uu: Real


class PlaceRate(Protocol):
    """The rate of one link as a function of where the UAV is."""

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate of every slot, bits (n,), at l and u (n,)."""

    def partials(self, gain_log: Real, cosine: Real) -> Partials:
        """Return the rate and its derivatives at l and u (n,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """l and u at positions w, with gradients (n, 2) and Hessians (n, 2, 2) by w."""

    gain_log: Real
    cosine: Real
    slope_l: Real
    slope_u: Real
    bend_l: Real
    bend_u: Real


def coordinates(link: Link, w: Real) -> tuple[Real, Real]:
    """Return l and u (n,) of `link` at the positions w (n, 2)."""
    away = w - link.station
    d2 = np.sum(away**2, axis=1) + link.altitude**2
    return np.log(link.reference_gain / d2), away[:, 0] / np.sqrt(d2)


def place(link: Link, w: Real) -> Place:
    """Return l and u with their first and second derivatives at the positions w (n, 2)."""
    away = w - link.station
    d2 = np.sum(away**2, axis=1) + link.altitude**2
    d = np.sqrt(d2)
    east = np.array([1.0, 0.0])
    x = away[:, :1]
    outer = away[:, :, None] * away[:, None, :]
    mixed = east[None, :, None] * away[:, None, :]
    per_d3 = (d**-3)[:, None, None]
    return Place(
        gain_log=np.log(link.reference_gain / d2),
        cosine=away[:, 0] / d,
        slope_l=-2 * away / d2[:, None],
        slope_u=east / d[:, None] - x * away / (d**3)[:, None],
        bend_l=-2 * np.eye(2) / d2[:, None, None] + 4 * outer / (d2**2)[:, None, None],
        bend_u=3 * x[:, :, None] * outer / (d**5)[:, None, None]
        - (mixed + np.swapaxes(mixed, 1, 2) + x[:, :, None] * np.eye(2)) * per_d3,
    )


def by_position(at: Place, rate: Partials) -> tuple[Real, Real]:
    """Return gradient (n, 2) and Hessian (n, 2, 2) of a rate by w, bits per m and per m²."""
    gradient = rate.by_l[:, None] * at.slope_l + rate.by_u[:, None] * at.slope_u
    l_l = at.slope_l[:, :, None] * at.slope_l[:, None, :]
    u_u = at.slope_u[:, :, None] * at.slope_u[:, None, :]
    l_u = at.slope_l[:, :, None] * at.slope_u[:, None, :]

    def times(factor: Real, matrix: Real) -> Real:
        return np.asarray(factor[:, None, None] * matrix)

    hessian = times(rate.by_l, at.bend_l) + times(rate.by_u, at.bend_u)
    hessian += times(rate.by_ll, l_l) + times(rate.by_uu, u_u)
    hessian += times(rate.by_lu, l_u + np.swapaxes(l_u, 1, 2))
    return gradient, hessian
