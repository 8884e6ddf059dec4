"""Radio-relay flights for finite alphabets: from a plan to a MAVLink mission.

>>> from faao_mav import plan_mission, read_plan
>>> result = plan_mission(read_plan("missions/copter_relay.yaml"))  # doctest: +SKIP
>>> result.write("mission.waypoints")  # doctest: +SKIP
(PosixPath('mission.waypoints'), PosixPath('mission.param'))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from faao_mav.autopilot import Track as Track
    from faao_mav.autopilot import Vehicle as Vehicle
    from faao_mav.autopilot.predict import predict as predict
    from faao_mav.errors import FaaoError as FaaoError
    from faao_mav.mission import Mission as Mission
    from faao_mav.mission import MissionItem as MissionItem
    from faao_mav.mission.formats import read_mission as read_mission
    from faao_mav.mission.formats import render_mission as render_mission
    from faao_mav.mission.formats.parameter_file import read_parameters as read_parameters
    from faao_mav.mission.formats.parameter_file import render_parameters as render_parameters
    from faao_mav.optimizer.optimize import optimize as optimize
    from faao_mav.optimizer.pricing import price as price
    from faao_mav.optimizer.pricing import saturation as saturation
    from faao_mav.optimizer.solution import Solution as Solution
    from faao_mav.optimizer.solution import load_solution as load_solution
    from faao_mav.optimizer.solution import save_solution as save_solution
    from faao_mav.plan import Plan as Plan
    from faao_mav.plan import parse_plan as parse_plan
    from faao_mav.plan import read_plan as read_plan
    from faao_mav.schedule import Conversion as Conversion
    from faao_mav.schedule import convert as convert
    from faao_mav.validate import Finding as Finding
    from faao_mav.validate import Limits as Limits
    from faao_mav.validate import LinkCheck as LinkCheck
    from faao_mav.validate.check import Check as Check
    from faao_mav.validate.check import check as check
    from faao_mav.wire import download as download
    from faao_mav.wire import upload as upload
    from faao_mav.workflow import Result as Result
    from faao_mav.workflow import plan_mission as plan_mission

_HOMES = {
    "errors": "FaaoError",
    "wire": "download upload",
    "mission": "Mission MissionItem",
    "mission.formats": "read_mission render_mission",
    "optimizer.optimize": "optimize",
    "optimizer.pricing": "price saturation",
    "optimizer.solution": "Solution load_solution save_solution",
    "plan": "Plan parse_plan read_plan",
    "schedule": "Conversion convert",
    "validate": "Finding Limits LinkCheck",
    "validate.check": "Check check",
    "autopilot": "Track Vehicle",
    "mission.formats.parameter_file": "read_parameters render_parameters",
    "autopilot.predict": "predict",
    "workflow": "Result plan_mission",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    # Imported on first use: `faao-mission --help` need not wait for the solvers.
    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
