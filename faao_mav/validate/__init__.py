"""Whether an autopilot takes a mission, an aircraft can fly it, and it delivers the link."""

from faao_mav.mission.item import Mission
from faao_mav.validate.case import Case
from faao_mav.validate.finding import Finding, Level
from faao_mav.validate.limits import Limits
from faao_mav.validate.link import LinkCheck, Stretch
from faao_mav.validate.registry import RULES
from faao_mav.validate.rule import Rule
from faao_mav.vehicle import Vehicle
from faao_mav.vehicle.track import Track

__all__ = [
    "RULES",
    "Finding",
    "Level",
    "Limits",
    "LinkCheck",
    "Rule",
    "Stretch",
    "validate",
]

_ORDER = {Level.ERROR: 0, Level.WARNING: 1, Level.NOTE: 2}


def validate(
    mission: Mission,
    vehicle: Vehicle,
    *,
    track: Track | None = None,
    limits: Limits | None = None,
    link: LinkCheck | None = None,
) -> tuple[Finding, ...]:
    """Return what all rules about `vehicle` find in `mission`, worst first, then by item.

    `track` is the predicted flight: with it speeds, heights, duration and fence are judged along
    the flight as well as along the straights between the items. `limits` are what the flight must
    stay within. `link` says what of a plan's rate the flight delivers. Any mission can be judged,
    however odd; nothing is raised.
    """
    case = Case(mission, vehicle, track, limits or Limits(), link)
    found = [
        finding for rule in RULES if rule.applies_to(vehicle) for finding in rule.findings(case)
    ]
    return tuple(sorted(found, key=lambda f: (_ORDER[f.level], -1 if f.item is None else f.item)))
