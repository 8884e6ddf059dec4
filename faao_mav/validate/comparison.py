"""A mission beside the plan that it is to carry out.

Of the mission only the predicted flight counts, so any mission can be compared: as it was made, as
it was edited in a ground station, as it was downloaded.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from faao_mav.autopilot import Track
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.plan.model import in_ground
from faao_mav.schedule.prediction import Prediction, passing, rates_along
from faao_mav.schedule.route import begins_at_speed
from faao_mav.schedule.timing import MOST_LEAD
from faao_mav.validate.demands import LATE_START, LinkCheck
from faao_mav.validate.flown import Line, departure
from faao_mav.validate.rule import threshold
from faao_mav.vector import distances_to_path, lengths

# Seconds about a departure like the plan's, of which the best fit is taken. A mission sets out up
# to `MOST_LEAD` before its plan. The step of 0.1 s is that of predicted flights.
_LEADS = np.arange(-MOST_LEAD, MOST_LEAD + 0.05, 0.1)


def compare_with_plan(solution: Solution, track: Track) -> tuple[LinkCheck, Prediction]:
    """Return what the flight `track` makes of the plan that `solution` solves.

    A flight that is nowhere near the plan is compared all the same.
    """
    line = predicted_line(solution, track)
    flown, plan = line.priced(solution), solution.plan
    link = LinkCheck(
        planned_rate=solution.rates.R_avg,
        predicted_rate=flown.rates.R_avg,
        planned_delivered=solution.delivered_rate,
        predicted_delivered=flown.delivered_rate,
        causal=plan.radio.causal,
        bandwidth_mhz=plan.radio.bandwidth_mhz,
        radio=plan.radio,
        planned_duration=plan.flight.duration,
        predicted_duration=flown.duration,
        rms_position_error=flown.rms_position_error,
        max_position_error=flown.max_position_error,
        path_error=flown.max_path_error,
        path_tolerance=plan.mission.path_tolerance,
        altitude_error=line.altitude_error(solution),
        unmeasured=tuple(_unmeasured(solution)),
        off_map=_off_map(plan, line),
        away=float(distances_to_path(line.w[:: int(threshold.every)], solution.w).min()),
        begins=float(track.t[0] - line.t[0]),
        late_share=_late_share(solution, flown),
    )
    return link, flown


def _off_map(plan: Plan, line: Line) -> str:
    """Return where the predicted flight first is in ground or off a map of the gain; "" nowhere."""
    aloft = line.up > plan.flight.altitude - threshold.lower
    t, w = line.t[aloft], line.w[aloft]
    low, high = plan.map_edge or ((-np.inf, -np.inf), (np.inf, np.inf))
    off = ((w < low) | (w > high)).any(axis=1)
    for gone, where in (
        (in_ground(plan.maps, plan.flight.altitude, w), "in the ground under"),
        (off, "off"),
    ):
        if gone.any():
            k = int(gone.argmax())
            east, north = w[k].round(1).tolist()
            return f"{where} the map of the gain at [{east:g}, {north:g}] m, after {t[k]:.0f} s"
    return ""


def _late_share(solution: Solution, flown: Prediction) -> float | None:
    """Return the part of the planned rate that is delivered `LATE_START` later; None: as much."""
    if not any(station.moves for station in solution.plan.radio.stations):
        return None
    late = replace(solution, problem=solution.problem.begun(LATE_START))
    delivered = solution.relay(*rates_along(late, flown.w), solution.shares).rate
    return delivered / solution.delivered_rate if solution.delivered_rate else 1.0


def _unmeasured(solution: Solution) -> Iterator[str]:
    """Yield where too many of the slots leave what the gain of a hop was measured at."""
    radio, height = solution.plan.radio, solution.plan.flight.altitude
    names = "base station", "ground user"
    for name, station, law in zip(names, radio.stations, radio.gain_laws, strict=True):
        away = lengths(solution.w - station.at(solution.t))
        angle, d = np.degrees(np.arctan2(height, away)), np.hypot(away, height)
        low, high = law.elevation_deg or (-np.inf, np.inf)
        beyond = np.maximum(low - angle, angle - high) > threshold.unmeasured_angle
        if np.mean(beyond) > threshold.unmeasured_share:
            seen = f"the {name} sees the route {angle.min():.0f} to {angle.max():.0f} degrees high"
            yield f"{seen}; the gain was measured from {low:.0f} to {high:.0f}"
        near, far = law.distance_m or (0.0, np.inf)
        beyond = (d * threshold.unmeasured_factor < near) | (d > far * threshold.unmeasured_factor)
        if np.mean(beyond) > threshold.unmeasured_share:
            seen = f"the route is {d.min():.0f} to {d.max():.0f} m from the {name}"
            yield f"{seen}; the gain was measured from {near:.0f} to {far:.0f} m"


def predicted_line(solution: Solution, track: Track | None) -> Line:
    """Return the predicted flight `track` on the plan's clock; the plan itself without one.

    The clock reads 0 when the flight departs from w_I most like the plan, or first comes near it
    where no departure is like it: when it passes w_I, for a plan that begins at speed; else up to
    `MOST_LEAD` earlier or later, when plan and flight are closest at equal times, rms: a mission
    does not say its lead.
    """
    if track is None:
        return Line.planned(solution)
    w, up = np.split(track.within(solution.plan.origin.frame), [2], axis=1)
    line = Line(track.t, w, up[:, 0])
    off, start = departure(solution, Line.planned(solution), line)
    if not math.isfinite(off):
        away = lengths(w - solution.w[0])
        start = float(line.t[np.argmax(away <= away.min() + solution.plan.mission.path_tolerance)])

    def apart(start: float) -> float:
        return float(np.mean(np.sum((line.at(solution.t + start) - solution.w) ** 2, axis=1)))

    if begins_at_speed(solution.t, solution.w):
        start = passing(line.t, w, solution.w[0], start)
    else:
        start = min((start + _LEADS).tolist(), key=apart)
    return line._replace(t=track.t - start)
