"""What the predicted flight of a mission delivers, against the plan."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.solution import Rates, Solution
from faao_mav.schedule.convert import Conversion
from faao_mav.schedule.delivery import delivered, nearest_slots
from faao_mav.schedule.deviation import deviation, settled


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The relay flight as it is predicted, on the plan's clock.

    `w` (n, 2), m, is where the aircraft is in each of the plan's slots. `I_U` and `I_G` (n,) of
    (7), (8), bits, are what it gets there with the slot's precoders; `by_position` are R_U and
    R_G if the radio takes the precoders of the slot planned nearest to where it is instead.
    `duration`, s, is T plus by how much later than planned the aircraft comes to w_F, within
    the path tolerance and for good. Errors are metres, at equal times and of the path.
    """

    w: Real
    I_U: Real
    I_G: Real
    by_position: Rates
    duration: float
    max_path_error: float
    max_position_error: float
    rms_position_error: float

    @property
    def rates(self) -> Rates:
        """R_U, R_G and R_avg of (9), (10), bit/s/Hz."""
        return Rates(float(self.I_U.mean()), float(self.I_G.mean()))


def predict_delivery(solution: Solution, conversion: Conversion) -> Prediction:
    """Price the channel of `solution` along the flight that its mission is predicted to make."""
    schedule = conversion.schedule
    t = schedule.flown.t - schedule.clock.start(schedule.flown)
    return price_flight(solution, t, schedule.flown.position[:, :2])


def price_flight(solution: Solution, t: Real, w: Real) -> Prediction:
    """Price the channel of `solution` along a flight that is at `w` (k, 2) m at times `t` (k,) s.

    The times are the plan's: 0 when its first slot begins. They increase.
    """
    at = np.stack([np.interp(solution.t, t, x) for x in w.T], axis=-1)
    near, end = solution.plan.mission.path_tolerance, solution.w[-1]
    due = float(solution.t[-1])
    late = settled(t, w, end, near, due) - settled(solution.t, solution.w, end, near, due)
    # a path flown late is the same path: it counts up to w_F
    within = (t >= solution.t[0]) & (t <= due + max(0.0, late))
    apart = deviation(solution.w, at, w[within] if within.any() else at)
    I_U, I_G = delivered(solution, at)
    near_U, near_G = delivered(solution, at, nearest_slots(solution, at))
    return Prediction(
        w=at,
        I_U=I_U,
        I_G=I_G,
        by_position=Rates(float(np.mean(near_U)), float(np.mean(near_G))),
        duration=solution.plan.flight.duration + late,
        max_path_error=apart.path,
        max_position_error=apart.max,
        rms_position_error=apart.rms,
    )
