"""Calibration finds the parameter that a flight was flown with."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import pytest
from conftest import FLYABLE, edited

from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import parse_plan
from faao_mav.schedule.conversion import Conversion, convert
from faao_mav.validate.calibrate import calibrate
from faao_mav.validate.comparison import on_the_plans_clock
from faao_mav.validate.flown import Line
from faao_mav.vehicle.predict import predict


@cache
def made() -> tuple[Solution, Conversion]:
    ends = {f"flight.{end}_velocity": "hover" for end in ("start", "end")}
    slow = {"vehicle.max_speed": 6, "flight.duration": 20, "mission.parameters": "keep"}
    solution = optimize(parse_plan(edited(FLYABLE, ends | slow)))
    return solution, convert(solution)


def flown(**parameters: float) -> Line:
    """Return the flight of the mission by a vehicle that has other `parameters`."""
    solution, conversion = made()
    vehicle = conversion.vehicle
    other = replace(vehicle, parameters={**vehicle.parameters, **parameters})
    track = predict(conversion.mission, other)
    return Line(*on_the_plans_clock(solution, track, lead=conversion.schedule.route.lead))


def test_the_parameter_that_was_another_one_is_found() -> None:
    found = calibrate(*made(), flown(WPNAV_ACCEL=175))
    assert found[0].name == "WPNAV_ACCEL"
    assert found[0].value == 250
    assert found[0].better == pytest.approx(175, rel=0.03)
    assert found[0].rms_better < 0.2 * found[0].rms
    assert all(a.rms_better <= b.rms_better < 0.9 * b.rms for a, b in pairwise(found))


def test_nothing_is_told_of_a_flight_as_predicted() -> None:
    assert calibrate(*made(), flown()) == []
