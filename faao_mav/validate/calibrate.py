"""Which parameters of a vehicle's flight model would have predicted a real flight better."""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import FaaoError
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Vector
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.schedule import positions_at
from faao_mav.validate.comparison import on_the_plans_clock
from faao_mav.validate.flown import Line
from faao_mav.vector import lengths
from faao_mav.vehicle import Vehicle
from faao_mav.vehicle.parameter import Parameter
from faao_mav.vehicle.predict import predict

_SCALES = (0.5, 0.7, 0.85, 1.2, 1.4, 2.0)
"""What each parameter is multiplied by first; between the neighbours of the best the least is then
searched. Chosen."""

_EXACT = 0.01
"""The relative error at which that search ends; chosen."""

_WORTH = 0.9
"""A parameter is told that lowers the error of the prediction to less than this share; chosen."""


@dataclass(frozen=True, slots=True)
class Calibrated:
    """A parameter that would have predicted a flight better, alone: `better` instead of `value`.

    Both are the autopilot's numbers under `name`. The prediction was `rms` metres from the flight
    at equal times, and is `rms_better` with it.
    """

    name: str
    value: float
    better: float
    rms: float
    rms_better: float


def calibrate(
    solution: Solution, conversion: Conversion, flight: Line, wind: Vector = (0.0, 0.0)
) -> list[Calibrated]:
    """Return the parameters that would have predicted `flight` better, each alone, the best first.

    `flight` is that of the mission of `conversion`, on the plan's clock, in a `wind`, m/s east and
    north. The error is the distance, rms, in the plan's slots. Parameters of 0, switches and those
    that the prediction does not depend on are left out. One flight does not tell parameters apart
    that do the same to it.
    """
    error = _Error(solution, conversion, flight, wind)
    before, found = error(conversion.vehicle), list[Calibrated]()
    for parameter in conversion.vehicle.type.parameters.values():
        best = _best_scale(error, conversion.vehicle, parameter, before)
        if best is not None and best[1] < _WORTH * before:
            name, value = _named(conversion.vehicle, parameter)
            better = float(f"{value * best[0]:.3g}")
            found.append(Calibrated(name, value, better, before, best[1]))
    return sorted(found, key=lambda each: each.rms_better)


class _Error:
    """The error of the prediction by a vehicle, m rms; infinite where it predicts no flight."""

    def __init__(
        self, solution: Solution, conversion: Conversion, flight: Line, wind: Vector
    ) -> None:
        self._solution, self._mission, self._wind = solution, conversion.mission, wind
        self._lead = conversion.schedule.route.lead
        self._flown: Real = positions_at(solution.t, *flight)

    def __call__(self, vehicle: Vehicle) -> float:
        try:
            track = predict(self._mission, vehicle, wind=self._wind)
        except FaaoError:
            return float("inf")
        line = on_the_plans_clock(self._solution, track, lead=self._lead)
        apart = lengths(positions_at(self._solution.t, *line) - self._flown)
        return float(np.sqrt(np.mean(apart**2)))


def _best_scale(
    error: _Error, vehicle: Vehicle, parameter: Parameter, before: float
) -> tuple[float, float] | None:
    """Return the scale of `parameter` at which `error` is least, and that error.

    None for one that does nothing, or is 0 or a switch.
    """
    if not parameter.unit or not vehicle.value(parameter.key):
        return None

    def at(scale: float) -> float:
        scaled = _scaled(vehicle, parameter, scale)
        return float("inf") if scaled is None else error(scaled)

    errors = {1.0: before} | {scale: at(scale) for scale in _SCALES}
    if all(abs(each - before) < 1e-6 for each in errors.values() if np.isfinite(each)):
        return None
    scales = sorted(errors)
    k = int(np.argmin([errors[scale] for scale in scales]))
    low, high = scales[max(k - 1, 0)], scales[min(k + 1, len(scales) - 1)]
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(at, bounds=(low, high), method="bounded", options={"xatol": _EXACT})
    return min([(float(found.x), float(found.fun)), *errors.items()], key=lambda each: each[1])


def _named(vehicle: Vehicle, parameter: Parameter) -> tuple[str, float]:
    """Return the name of `parameter`, as the vehicle has it, and its number."""
    name = parameter.name_in(vehicle.parameters) or parameter.oldest_name
    return name, vehicle.parameters.get(name, parameter.written(parameter.default, name))


def _scaled(vehicle: Vehicle, parameter: Parameter, scale: float) -> Vehicle | None:
    """Return `vehicle` with `parameter` times `scale`; None where that is no use."""
    name, value = _named(vehicle, parameter)
    number = value * scale
    if not parameter.is_usable(number, name):
        return None
    return replace(vehicle, parameters={**vehicle.parameters, name: number})
