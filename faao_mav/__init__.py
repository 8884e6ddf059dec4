"""Radio-relay flights for finite alphabets: from a plan to a MAVLink mission.

>>> from faao_mav import optimize, read_plan  # doctest: +SKIP
>>> solution = optimize(read_plan("missions/copter_relay.yaml"))  # doctest: +SKIP
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from faao_mav.errors import FaaoError
    from faao_mav.mavlink import download, upload
    from faao_mav.mission import Mission, MissionItem
    from faao_mav.mission.formats import read_mission, render_mission
    from faao_mav.optimizer.optimize import optimize
    from faao_mav.optimizer.pricing import price, saturation
    from faao_mav.optimizer.solution import Solution, load_solution, save_solution
    from faao_mav.plan import Plan, parse_plan, read_plan
    from faao_mav.validate import Finding, Limits, LinkCheck
    from faao_mav.vehicle import Vehicle
    from faao_mav.vehicle.parameter_file import read_parameters, render_parameters

_HOMES = {
    "FaaoError": "errors",
    "Finding": "validate",
    "Limits": "validate",
    "LinkCheck": "validate",
    "Mission": "mission",
    "MissionItem": "mission",
    "Plan": "plan",
    "Solution": "optimizer.solution",
    "Vehicle": "vehicle",
    "download": "mavlink",
    "load_solution": "optimizer.solution",
    "optimize": "optimizer.optimize",
    "parse_plan": "plan",
    "price": "optimizer.pricing",
    "read_mission": "mission.formats",
    "read_parameters": "vehicle.parameter_file",
    "read_plan": "plan",
    "render_mission": "mission.formats",
    "render_parameters": "vehicle.parameter_file",
    "saturation": "optimizer.pricing",
    "save_solution": "optimizer.solution",
    "upload": "mavlink",
}

__all__ = [
    "FaaoError",
    "Finding",
    "Limits",
    "LinkCheck",
    "Mission",
    "MissionItem",
    "Plan",
    "Solution",
    "Vehicle",
    "download",
    "load_solution",
    "optimize",
    "parse_plan",
    "price",
    "read_mission",
    "read_parameters",
    "read_plan",
    "render_mission",
    "render_parameters",
    "saturation",
    "save_solution",
    "upload",
]


def __getattr__(name: str) -> Any:
    # Imported on first use: `faao-mission --help` need not wait for the solvers.
    if name in _HOMES:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
