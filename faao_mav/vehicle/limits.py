"""Flight limits from an autopilot's parameters."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from faao_mav.errors import InputError
from faao_mav.mission.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Parameter:
    """Where a limit comes from: `names`, newest first, each with what makes its value SI.

    A vehicle has one generation of names; a file may carry both. `least`, SI, is the smallest
    size (of either sign if `signed`) that makes sense.
    """

    names: Mapping[str, float]
    least: float
    signed: bool = False


def limits_of(vehicle: Vehicle, parameters: Mapping[str, Parameter]) -> dict[str, float]:
    """Return those of the limits, SI, that `vehicle.parameters` set.

    Raises `InputError` that names source, parameter and value if one is useless.
    """
    limits = {}
    for limit, parameter in parameters.items():
        for name, unit in parameter.names.items():
            if name in vehicle.parameters:
                limits[limit] = unit * _checked(vehicle, name, parameter.least / unit, parameter)
                break
    return limits


def _checked(vehicle: Vehicle, name: str, least: float, parameter: Parameter) -> float:
    value = vehicle.parameters[name]
    size = abs(value) if parameter.signed else value
    if not (math.isfinite(value) and size >= least):
        sign = " of either sign" if parameter.signed else ""
        raise InputError(
            f"{vehicle.source}: {name}: {value:g}; give a number of at least {least:g}{sign}"
        )
    return value
