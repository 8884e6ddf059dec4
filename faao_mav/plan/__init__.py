"""The plan: `plan.yaml` read, checked and turned into SI units."""

from faao_mav.plan.model import (
    BaseStation,
    Flight,
    GroundUser,
    MissionOptions,
    Optimizer,
    Origin,
    Plan,
    Radio,
    Relay,
    Vector,
    Vehicle,
)
from faao_mav.plan.reader import parse_plan, read_plan

__all__ = [
    "BaseStation",
    "Flight",
    "GroundUser",
    "MissionOptions",
    "Optimizer",
    "Origin",
    "Plan",
    "Radio",
    "Relay",
    "Vector",
    "Vehicle",
    "parse_plan",
    "read_plan",
]
