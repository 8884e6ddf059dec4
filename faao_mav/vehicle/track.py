"""Where an aircraft is predicted to be, and when."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The predicted flight of a whole mission.

    `t` (n,), s, counts from the start of the mission; `position` (n, 3) and `velocity` (n, 3) are
    east, north, up in metres about `frame`'s origin (up: above home) and m/s; `item` (n,) is the
    index into `Mission.items` of the item under way. `reached` (items,), s, is when each item was
    done, NaN for items that take no time of their own or never end.
    """

    t: Real
    position: Real
    velocity: Real
    item: NDArray[np.int_]
    reached: Real
    frame: LocalFrame
