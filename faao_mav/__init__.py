"""Radio-relay flights for finite alphabets: from a plan to a MAVLink mission.

>>> from faao_mav import optimize, read_plan, to_mission  # doctest: +SKIP
>>> solution = optimize(read_plan("missions/copter_relay.yaml"))  # doctest: +SKIP
>>> mission = to_mission(solution)  # doctest: +SKIP
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from faao_mav.errors import FaaoError
    from faao_mav.faao.optimize import optimize
    from faao_mav.faao.pricing import price, saturation
    from faao_mav.faao.solution import Solution, load_solution, save_solution
    from faao_mav.mavlink import download, upload
    from faao_mav.mission import Mission, MissionItem, to_mission
    from faao_mav.mission.formats import read_mission, render_mission
    from faao_mav.mission.parameter_file import read_parameters, render_parameters
    from faao_mav.mission.validate import Finding, Limits, LinkCheck, validate
    from faao_mav.mission.vehicle import Vehicle
    from faao_mav.plan import Plan, parse_plan, read_plan

_HOMES = {
    "FaaoError": "errors",
    "Finding": "mission.validate",
    "Limits": "mission.validate",
    "LinkCheck": "mission.validate",
    "Mission": "mission",
    "MissionItem": "mission",
    "Plan": "plan",
    "Solution": "faao.solution",
    "Vehicle": "mission.vehicle",
    "download": "mavlink",
    "load_solution": "faao.solution",
    "optimize": "faao.optimize",
    "parse_plan": "plan",
    "price": "faao.pricing",
    "read_mission": "mission.formats",
    "read_parameters": "mission.parameter_file",
    "read_plan": "plan",
    "render_mission": "mission.formats",
    "render_parameters": "mission.parameter_file",
    "saturation": "faao.pricing",
    "save_solution": "faao.solution",
    "to_mission": "mission",
    "upload": "mavlink",
    "validate": "mission.validate",
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
    "to_mission",
    "upload",
    "validate",
]


def __getattr__(name: str) -> Any:
    # Imported on first use: `faao-mission --help` need not wait for the solvers.
    if name in _HOMES:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
