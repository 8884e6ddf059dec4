"""Where items fly to, and the straights between them."""

import math
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real

HOME = -1
"""The index of home, which is no item."""


@dataclass(frozen=True, slots=True)
class PlacedItem:
    """Where an item flies to: metres east and north of `ValidationContext.frame`, and above home.

    `index` is the item's, `HOME` for home. `up` is NaN where nothing tells it: heights above
    terrain, or above the sea without a home.
    """

    index: int
    east: float
    north: float
    up: float

    @property
    def name(self) -> str:
        """What people call it."""
        return "home" if self.index == HOME else f"item {self.index + 1}"

    @property
    def ground(self) -> Real:
        """East and north, (2,) m."""
        return np.array([self.east, self.north])

    @property
    def from_origin(self) -> float:
        """Metres over ground from the origin of the frame, which is home if there is one."""
        return math.hypot(self.east, self.north)


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight from one place to the next, ordered by the item at `index`.

    `speed` is what is commanded, m/s; `spline`: the aircraft curves to its end; `jump`: the item
    is a jump.
    """

    index: int
    start: PlacedItem
    end: PlacedItem
    speed: float
    spline: bool = False
    jump: bool = False

    @property
    def length(self) -> float:
        """Metres over ground."""
        return math.hypot(self.end.east - self.start.east, self.end.north - self.start.north)

    @property
    def rise(self) -> float:
        """Metres upwards; NaN if a height is unknown."""
        return self.end.up - self.start.up

    def turn(self, onward: "Straight") -> float:
        """Return the turn from here to the straight `onward`, rad, 0 to pi; 0 without a heading."""
        before, after = (
            complex(each.end.east - each.start.east, each.end.north - each.start.north)
            for each in (self, onward)
        )
        across = after * before.conjugate()
        return abs(math.atan2(across.imag, across.real))
