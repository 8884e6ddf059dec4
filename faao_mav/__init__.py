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
    from faao_mav.plan import Plan, parse_plan, read_plan

_HOMES = {
    "FaaoError": "errors",
    "Mission": "mission",
    "MissionItem": "mission",
    "Plan": "plan",
    "Solution": "faao.solution",
    "download": "mavlink",
    "load_solution": "faao.solution",
    "optimize": "faao.optimize",
    "parse_plan": "plan",
    "price": "faao.pricing",
    "read_mission": "mission.formats",
    "read_plan": "plan",
    "render_mission": "mission.formats",
    "saturation": "faao.pricing",
    "save_solution": "faao.solution",
    "to_mission": "mission",
    "upload": "mavlink",
}

__all__ = [
    "FaaoError",
    "Mission",
    "MissionItem",
    "Plan",
    "Solution",
    "download",
    "load_solution",
    "optimize",
    "parse_plan",
    "price",
    "read_mission",
    "read_plan",
    "render_mission",
    "saturation",
    "save_solution",
    "to_mission",
    "upload",
]


def __getattr__(name: str) -> Any:
    # Imported on first use: `faao-mission --help` need not wait for the solvers.
    if name in _HOMES:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
