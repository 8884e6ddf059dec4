"""A mission beside the plan that it is to carry out.

Of the mission only the predicted flight counts, so any mission can be compared: as it was made, as
it was edited in a ground station, as it was downloaded.
"""

import numpy as np

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.initial_route import begins_at_speed, set_out
from faao_mav.schedule.prediction import Prediction, price_flight
from faao_mav.schedule.schedule import passing
from faao_mav.schedule.timing import MOST_LEAD
from faao_mav.validate.link import LinkCheck, Stretch
from faao_mav.vector import lengths
from faao_mav.vehicle.track import Track

_LEADS = np.arange(0.0, MOST_LEAD + 0.05, 0.1)

_LEAST = 1e-6
"""bit/s/Hz: less is not lost but rounded."""


def compare_with_plan(solution: Solution, track: Track, *, lead: float | None = None) -> LinkCheck:
    """Return what the flight `track` makes of the plan that `solution` solves.

    The plan leaves w_I when the flight leaves the item nearest to it (of several the one that
    brings both closest at equal times, rms), or `lead` seconds later. Without one, as a mission
    does not say by how much the aircraft sets out before the plan, it is what brings both closest,
    up to `timing.MOST_LEAD`. A plan that begins at speed does when the flight passes w_I. A track
    that is nowhere near is compared all the same.
    """
    w = _in_frame_of(solution, track)
    start = _start(solution, track, w, lead)
    t = track.t - start
    flown = price_flight(solution, t, w)
    during = np.interp(solution.t, t, track.position[:, 2])
    plan = solution.plan
    return LinkCheck(
        planned_rate=solution.rates.R_avg,
        predicted_rate=flown.rates.R_avg,
        planned_duration=plan.flight.duration,
        predicted_duration=flown.duration,
        rms_position_error=flown.rms_position_error,
        max_position_error=flown.max_position_error,
        path_error=flown.max_path_error,
        path_tolerance=plan.mission.path_tolerance,
        altitude_error=float(np.abs(during - plan.flight.altitude).max()),
        worst=_worst(solution, flown),
    )


def _in_frame_of(solution: Solution, track: Track) -> Real:
    """Return the positions (k, 2) of `track` in the plan's local metres."""
    own = LocalFrame(solution.plan.origin.latitude, solution.plan.origin.longitude)
    if track.frame == own:
        return track.position[:, :2]
    return own.to_local(*track.frame.to_geodetic(track.position[:, :2]))


def _start(solution: Solution, track: Track, w: Real, lead: float | None) -> float:
    """Return when, on the clock of `track`, the plan's reads 0."""
    waited = set_out(solution.t, solution.w, solution.plan) - solution.t[0]
    moving = waited == 0 and begins_at_speed(solution.t, solution.w)
    left = track.reached[np.isfinite(track.reached)]
    if len(left) == 0:
        return float(track.t[0])
    where = np.stack([np.interp(left, track.t, x) for x in w.T], axis=-1)
    away = lengths(where - solution.w[0])
    near = left[away <= away.min() + solution.plan.mission.path_tolerance] - waited

    def apart(start: float) -> float:
        at = [np.interp(solution.t + start, track.t, x) for x in w.T]
        return float(np.mean(np.sum((np.stack(at, axis=-1) - solution.w) ** 2, axis=1)))

    nearest = min(map(float, near), key=apart)
    if moving:
        return passing(track.t, w, solution.w[0], nearest)
    if lead is not None:
        return nearest + lead
    return min((nearest + each for each in map(float, _LEADS)), key=apart)


def _worst(solution: Solution, flown: Prediction) -> Stretch | None:
    """Return the stretch of slots that costs the link that limits the rate most."""
    planned, found = (
        (solution.I_U, flown.I_U)
        if flown.rates.R_U <= flown.rates.R_G
        else (solution.I_G, flown.I_G)
    )
    lost = np.concatenate([[0.0], np.cumsum(planned - found)]) / len(planned)
    # The sum from slot i to slot j - 1 is lost[j] - lost[i], the greatest over the least before.
    least = np.minimum.accumulate(lost)
    end = int(np.argmax(lost - least))
    begin = int(np.argmin(lost[: end + 1]))
    if lost[end] - lost[begin] < _LEAST:
        return None
    step = float(solution.t[1] - solution.t[0])
    first, last = float(solution.t[begin]), float(solution.t[end - 1]) + step
    return Stretch(first, last, float(lost[end] - lost[begin]))
