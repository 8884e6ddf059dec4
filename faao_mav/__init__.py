"""Radio-relay flights for finite alphabets: from a plan to a MAVLink mission.

>>> from faao_mav import plan_mission, read_plan
>>> result = plan_mission(read_plan("missions/copter_relay.yaml"))  # doctest: +SKIP
>>> result.write("mission.waypoints")  # doctest: +SKIP
(PosixPath('mission.waypoints'), PosixPath('mission.param'))

The public names, which are imported when they are first used:

- plans: `Plan`, `read_plan`, `parse_plan`
- the flight and its precoders: `optimize`, `Solution`, `save_solution`, `load_solution`, `Problem`,
  `build_problem`, `upper_bound`, `price`, `saturation`
- all of the command's work: `plan_mission`, `Result`, `convert`, `Conversion`
- missions: `Mission`, `MissionItem`, `read_mission`, `render_mission`, `read_parameters`,
  `render_parameters`, `Vehicle`, `predict`, `Track`, `check`, `Check`, `Finding`, `Limits`,
  `LinkCheck`
- on the vehicle: `upload`, `download`, `fly_mission`, `Flight`, `read_log`, `debrief`
- the radio: `PathGain`, `GainFunction`, `StreamRate`, `OwnParts`, `fit_link`, `LinkFit`,
  `Samples`, `read_measured`
- many plans: `run_study`, `make_cases`, `parse_vary`, `StudyRow`, `as_array`
- figures and pages: `flight_figure`, `route_figure`, `study_figure`, `save_figure`,
  `render_report`
- errors: `FaaoError`, `InputError`, `PlanError`, `MissionFileError`, `ParameterFileError`,
  `InfeasibleError`, `SolverError`, `LinkError`
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from faao_mav.autopilot import Track as Track
    from faao_mav.autopilot import Vehicle as Vehicle
    from faao_mav.autopilot.predict import predict as predict
    from faao_mav.errors import FaaoError as FaaoError
    from faao_mav.errors import InfeasibleError as InfeasibleError
    from faao_mav.errors import InputError as InputError
    from faao_mav.errors import LinkError as LinkError
    from faao_mav.errors import MissionFileError as MissionFileError
    from faao_mav.errors import ParameterFileError as ParameterFileError
    from faao_mav.errors import PlanError as PlanError
    from faao_mav.errors import SolverError as SolverError
    from faao_mav.fly.fly import fly_mission as fly_mission
    from faao_mav.fly.logs import read_log as read_log
    from faao_mav.fly.preflight import Flight as Flight
    from faao_mav.mission import Mission as Mission
    from faao_mav.mission import MissionItem as MissionItem
    from faao_mav.mission.formats import read_mission as read_mission
    from faao_mav.mission.formats import render_mission as render_mission
    from faao_mav.mission.formats.parameter_file import read_parameters as read_parameters
    from faao_mav.mission.formats.parameter_file import render_parameters as render_parameters
    from faao_mav.optimizer.optimize import optimize as optimize
    from faao_mav.optimizer.pricing import price as price
    from faao_mav.optimizer.pricing import saturation as saturation
    from faao_mav.optimizer.problem import OwnParts as OwnParts
    from faao_mav.optimizer.problem import Problem as Problem
    from faao_mav.optimizer.problem import build_problem as build_problem
    from faao_mav.optimizer.search.bound import upper_bound as upper_bound
    from faao_mav.optimizer.solution import Solution as Solution
    from faao_mav.optimizer.solution import load_solution as load_solution
    from faao_mav.optimizer.solution import save_solution as save_solution
    from faao_mav.plan import Plan as Plan
    from faao_mav.plan import parse_plan as parse_plan
    from faao_mav.plan import read_plan as read_plan
    from faao_mav.radio.fit import LinkFit as LinkFit
    from faao_mav.radio.fit import Samples as Samples
    from faao_mav.radio.fit import fit_link as fit_link
    from faao_mav.radio.gain import GainFunction as GainFunction
    from faao_mav.radio.gain import PathGain as PathGain
    from faao_mav.radio.measured import read_measured as read_measured
    from faao_mav.radio.rate_steps import StreamRate as StreamRate
    from faao_mav.report.debrief import debrief as debrief
    from faao_mav.report.figures import flight_figure as flight_figure
    from faao_mav.report.figures import route_figure as route_figure
    from faao_mav.report.page import render_report as render_report
    from faao_mav.report.style import save_figure as save_figure
    from faao_mav.schedule import Conversion as Conversion
    from faao_mav.schedule import convert as convert
    from faao_mav.study import StudyRow as StudyRow
    from faao_mav.study import as_array as as_array
    from faao_mav.study import make_cases as make_cases
    from faao_mav.study import parse_vary as parse_vary
    from faao_mav.study import run_study as run_study
    from faao_mav.study import study_figure as study_figure
    from faao_mav.validate import Check as Check
    from faao_mav.validate import Finding as Finding
    from faao_mav.validate import Limits as Limits
    from faao_mav.validate import LinkCheck as LinkCheck
    from faao_mav.validate import check as check
    from faao_mav.wire import download as download
    from faao_mav.wire import upload as upload
    from faao_mav.workflow import Result as Result
    from faao_mav.workflow import plan_mission as plan_mission

_HOMES = {
    "autopilot": "Track Vehicle",
    "autopilot.predict": "predict",
    "errors": "FaaoError InfeasibleError InputError LinkError MissionFileError ParameterFileError "
    "PlanError SolverError",
    "fly.fly": "fly_mission",
    "fly.logs": "read_log",
    "fly.preflight": "Flight",
    "mission": "Mission MissionItem",
    "mission.formats": "read_mission render_mission",
    "mission.formats.parameter_file": "read_parameters render_parameters",
    "optimizer.optimize": "optimize",
    "optimizer.pricing": "price saturation",
    "optimizer.problem": "OwnParts Problem build_problem",
    "optimizer.search.bound": "upper_bound",
    "optimizer.solution": "Solution load_solution save_solution",
    "plan": "Plan parse_plan read_plan",
    "radio.fit": "LinkFit Samples fit_link",
    "radio.gain": "GainFunction PathGain",
    "radio.measured": "read_measured",
    "radio.rate_steps": "StreamRate",
    "report.debrief": "debrief",
    "report.figures": "flight_figure route_figure",
    "report.page": "render_report",
    "report.style": "save_figure",
    "schedule": "Conversion convert",
    "study": "StudyRow as_array make_cases parse_vary run_study study_figure",
    "validate": "Check Finding Limits LinkCheck check",
    "wire": "download upload",
    "workflow": "Result plan_mission",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    # Imported on first use: `faao-mission --help` need not wait for the solvers.
    if name == "__version__":
        from importlib.metadata import version

        return version("faao-mav")
    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__doc__", "__version__"]
