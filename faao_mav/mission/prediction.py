"""What the predicted flight of a mission delivers, against the plan."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.faao.solution import Rates, Solution
from faao_mav.mission.convert import Conversion
from faao_mav.mission.delivery import delivered, nearest_slots


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The relay flight as it is predicted, on the plan's clock.

    `w` (n, 2), m, is where the aircraft is in each of the plan's slots. `I_U` and `I_G` (n,) of
    (7), (8), bits, are what it gets there with the slot's precoders; `by_position` are R_U and
    R_G if the radio takes the precoders of the slot planned nearest to where it is instead.
    `duration`, s, is from w_I to the end of the slot that begins with the arrival at w_F: T, if
    the aircraft keeps the plan. Errors are metres, at equal times and of the path.
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
    w = schedule.positions(solution.t)
    I_U, I_G = delivered(solution, w)
    near_U, near_G = delivered(solution, w, nearest_slots(solution, w))
    apart = schedule.deviation
    arrival = float(schedule.flown.arrivals[schedule.route.last])
    slot = solution.plan.flight.time_step
    return Prediction(
        w=w,
        I_U=I_U,
        I_G=I_G,
        by_position=Rates(float(np.mean(near_U)), float(np.mean(near_G))),
        duration=arrival - schedule.clock.start(schedule.flown) + slot,
        max_path_error=apart.path,
        max_position_error=apart.max,
        rms_position_error=apart.rms,
    )
