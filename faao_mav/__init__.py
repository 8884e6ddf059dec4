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

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_HOMES = {
    name.name: line.module
    for line in _STUB.body
    if isinstance(line, ast.ImportFrom) and line.module
    for name in line.names
}
"""The module that has each public name."""

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    # Imported on first use: `faao-mission --help` need not wait for the solvers.
    if name == "__version__":
        from importlib.metadata import version

        return version("faao-mav")
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__doc__", "__version__"]
