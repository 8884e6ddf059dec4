"""Whether an autopilot takes a mission, an aircraft can fly it, and it delivers the link."""

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.dialect import name_of
from faao_mav.autopilot.vehicle_type import OVERSPEED
from faao_mav.errors import FaaoError
from faao_mav.mission.item import Mission
from faao_mav.plan import Vector
from faao_mav.validate import delivery, extent, fences, items, peculiar, speeds  # noqa: F401
from faao_mav.validate.context import ValidationContext as ValidationContext
from faao_mav.validate.demands import EnergyUse, energy_use
from faao_mav.validate.demands import Limits as Limits
from faao_mav.validate.demands import LinkCheck as LinkCheck
from faao_mav.validate.rule import CHECKS, read_rules, threshold
from faao_mav.validate.rule import Finding as Finding
from faao_mav.validate.rule import Level as Level
from faao_mav.validate.rule import Rule as Rule

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Solution
    from faao_mav.schedule.prediction import Prediction

_CONSTANTS: dict[str, object] = {"threshold": threshold, "spare": 100 * (OVERSPEED - 1)}

RULES = tuple(read_rules("validate/rules.tsv", _CONSTANTS))
"""All rules, in the order of their table, in which findings about one item are given."""

_PLACE = {rule.id: n for n, rule in enumerate(RULES)}


def validate(context: ValidationContext) -> tuple[Finding, ...]:
    """Return what all rules about its vehicle find in `context`, worst first, then by item.

    Any mission can be judged, however odd; nothing is raised.

    >>> from faao_mav.autopilot import Vehicle
    >>> from faao_mav.mission.item import Mission
    >>> [finding.rule for finding in validate(ValidationContext(Mission(()), Vehicle()))]
    ['empty']
    """
    vehicle, limits, link = context.vehicle, context.limits, context.link
    shown = {**_CONSTANTS, "vehicle": vehicle, "limits": limits, "link": link}
    found = []
    for name, index, values in chain.from_iterable(check(context) for check in CHECKS):
        rule = RULES[_PLACE[name]]
        if rule.applies_to(vehicle):
            item = context.items[index] if index is not None else None
            about = {"item": item, "command": name_of(item.command) if item is not None else ""}
            found.append(rule.finding(index, shown | about | values))

    found.sort(key=lambda each: (list(Level).index(each.level), each.item or 0, _PLACE[each.rule]))
    return tuple(found)


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """What was found in `mission` for `vehicle`.

    `track` is the predicted flight; where there is none `unpredicted` says why. `link` is what the
    flight makes of a plan, and `prediction` how it flies that, slot by slot; both are None without
    a plan or a track. `findings` are the worst first. `wind`,
    m/s, is what `track` is predicted in, `energy` what the flight takes, None where no plan tells
    its power.

    >>> from faao_mav import Vehicle, check, read_mission
    >>> check(read_mission("tests/data/missions/plain.waypoints"), Vehicle())
    <Check of <Mission: 5 items, 0 zones, 0 rally points>: 0 errors, 0 warnings, 0 notes>
    """

    mission: Mission
    vehicle: Vehicle
    track: Track | None = None
    unpredicted: str = ""
    link: LinkCheck | None = None
    findings: tuple[Finding, ...] = ()
    wind: Vector = (0.0, 0.0)
    energy: EnergyUse | None = None
    prediction: "Prediction | None" = None

    def __repr__(self) -> str:
        """Say what was found, in a line."""
        found = ", ".join(f"{len(self.of(level))} {level.name.lower()}s" for level in Level)
        return f"<Check of {self.mission!r}: {found}>"

    def of(self, level: Level) -> tuple[Finding, ...]:
        """Return the findings of `level`."""
        return tuple(finding for finding in self.findings if finding.level is level)


def check(
    mission: Mission,
    vehicle: Vehicle,
    *,
    limits: Limits | None = None,
    solution: "Solution | None" = None,
    wind: Vector | None = None,
) -> Check:
    """Predict the flight of `mission` by `vehicle` and judge both by all rules.

    The flight is predicted in a `wind`, east and north, m/s: without one in that of the plan, or in
    none. With a `solution` the flight is judged by what it makes of that plan too, from the ground
    or from the air, as the plan has it. A mission that cannot be predicted is judged by its items
    alone; nothing is raised.

    >>> from faao_mav.mission import Mission, MissionItem
    >>> from faao_mav.autopilot import Vehicle
    >>> land = MissionItem(command=21, frame=3, x=47.4, y=8.5)
    >>> found = check(Mission(items=(land,)), Vehicle("px4"))
    >>> [finding.rule for finding in found.of(Level.ERROR)]
    ['px4-starts-with-land']
    """
    if wind is None:
        wind = solution.plan.wind if solution is not None else (0.0, 0.0)
    track, unpredicted = predicted(mission, vehicle, wind)
    link = prediction = energy = None
    if solution is not None and track is not None:
        from faao_mav.validate.comparison import compare_with_plan  # the radio's code

        link, prediction = compare_with_plan(solution, track)
        energy = energy_use(solution.plan, track.t, track.velocity, wind, lands=track.lands)
    airborne = solution is not None and not solution.plan.mission.takeoff
    why = "" if solution is None else unpredicted
    beside = (track, limits or Limits(), link, airborne, energy, why)
    findings = validate(ValidationContext(mission, vehicle, *beside))
    return Check(mission, vehicle, track, unpredicted, link, findings, wind, energy, prediction)


def predicted(mission: Mission, vehicle: Vehicle, wind: Vector) -> tuple[Track | None, str]:
    """Return the predicted flight, or None and why there is none."""
    from faao_mav.autopilot.predict import predict

    try:
        track = predict(mission, vehicle, wind=wind)
    except FaaoError as error:
        return None, str(error)
    return (track, "") if len(track.t) else (None, "there is nothing to fly")
