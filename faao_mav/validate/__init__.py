"""Whether an autopilot takes a mission, an aircraft can fly it, and it delivers the link."""

from faao_mav.validate import ardupilot, delivery, extent, fences, items, px4, speeds
from faao_mav.validate.context import ValidationContext as ValidationContext
from faao_mav.validate.demands import Limits as Limits
from faao_mav.validate.demands import LinkCheck as LinkCheck
from faao_mav.validate.demands import Stretch as Stretch
from faao_mav.validate.rule import Finding as Finding
from faao_mav.validate.rule import Level as Level
from faao_mav.validate.rule import Rule as Rule
from faao_mav.validate.rule import hits, read_rules

_MODULES = (ardupilot, delivery, extent, fences, items, px4, speeds)
_CONSTANTS: dict[str, object] = {module.__name__.rpartition(".")[2]: module for module in _MODULES}

RULES = tuple(read_rules(_CONSTANTS))
"""All rules, in the order of their table, in which findings about one item are given."""

_PLACE = {rule.id: n for n, rule in enumerate(RULES)}
_WORST_FIRST = list(Level)


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
    for name, index, values in hits(context):
        rule = RULES[_PLACE[name]]
        if rule.applies_to(vehicle):
            found.append(rule.finding(index, shown | context.about(index) | values))

    def order(finding: Finding) -> tuple[int, int, int]:
        level = _WORST_FIRST.index(finding.level)
        return level, finding.item or 0, _PLACE[finding.rule]

    return tuple(sorted(found, key=order))
