"""The plan: `plan.yaml` read, checked and turned into SI units.

`model` declares the keys and what they mean, `reader` reads them, `keys.reference` lists them.
"""

from faao_mav.plan.fields import Vector
from faao_mav.plan.keys import PlanKey, reference
from faao_mav.plan.reader import parse_plan, read_plan
from faao_mav.plan.sections import (
    BaseStation,
    Flight,
    GroundUser,
    MissionOptions,
    Optimizer,
    Origin,
    Plan,
    Radio,
    Relay,
    Site,
    VehicleOptions,
    Wind,
)

__all__ = [
    "BaseStation",
    "Flight",
    "GroundUser",
    "MissionOptions",
    "Optimizer",
    "Origin",
    "Plan",
    "PlanKey",
    "Radio",
    "Relay",
    "Site",
    "Vector",
    "VehicleOptions",
    "Wind",
    "parse_plan",
    "read_plan",
    "reference",
]
