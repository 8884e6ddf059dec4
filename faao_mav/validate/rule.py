"""What a rule is and finds, the table of all rules, the checks behind it, and findings in words."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby
from typing import TYPE_CHECKING, TypeAlias

from faao_mav.autopilot import Vehicle
from faao_mav.errors import counted
from faao_mav.files import numbers, table

if TYPE_CHECKING:
    from faao_mav.validate.context import ValidationContext


_MAX_RUNS_SHOWN = 8
"""Runs of item numbers that are named in one line; chosen: about a line of a terminal."""


class Level(StrEnum):
    """How bad it is.

    `ERROR`: the autopilot refuses the mission, or the flight is dangerous or breaks a limit that
    was set. `WARNING`: it will not fly as it is written. `NOTE`: worth knowing.
    """

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that a rule found.

    `item` is the number that people see: the row of a `.waypoints` file, where row 0 is home, and
    the item's number in QGroundControl and Mission Planner; None if it is about no single item.
    `message` says what is the case, with the value and the limit; `action` what to do about it, ""
    for nothing.

    >>> from faao_mav import Vehicle, check, read_mission
    >>> mission = read_mission("tests/data/validate/crosses-no-fly-circle.plan")
    >>> first, *_ = check(mission, Vehicle()).findings
    >>> first.level.name, first.rule, first.item
    ('ERROR', 'fence-leg', 3)
    """

    level: Level
    rule: str
    item: int | None
    message: str
    action: str


@dataclass(frozen=True, slots=True)
class Rule:
    """One thing that is checked.

    `id` is short and stays the same from version to version. `autopilot` and `kind` are the
    autopilot and the type of vehicle that it is about, "": all. `summary` says in a line what is
    wrong when the rule speaks. `says` is that with the values of a hit, "" where there are none,
    and `do` what to do about it. `source` names where the rule comes from: a function or document
    of the autopilot with its version, a measurement, or the limits that were set.
    """

    level: Level
    id: str
    says: str
    do: str
    summary: str = ""
    autopilot: str = ""
    kind: str = ""
    source: str = ""

    def applies_to(self, vehicle: Vehicle) -> bool:
        """Say whether the rule is about `vehicle`."""
        return self.autopilot in ("", vehicle.autopilot) and self.kind in ("", vehicle.kind)

    def finding(self, index: int | None, values: Mapping[str, object]) -> Finding:
        """Return what it says of the item at `index`, with `values` for the names in braces."""
        says, do = (text.format_map(values) for text in (self.says or self.summary, self.do))
        return Finding(self.level, self.id, None if index is None else index + 1, says, do)


threshold = numbers("validate/thresholds.tsv")
"""The thresholds of the rules, by their names in the table `thresholds.tsv`."""


def read_rules(name: str, constants: Mapping[str, object]) -> Iterator[Rule]:
    """Yield the rules of the table `name`; a summary may name `constants` in braces."""
    for row in table(name):
        told = {**row, "summary": row.get("summary", "").format_map(constants)}
        yield Rule(level=Level(told.pop("level")), **told)


Hit: TypeAlias = tuple[str, int | None, dict[str, object]]
"""That a rule, by its id, holds at the index of an item in `Mission.items`, or at none; and the
values that go into the rule's texts, by their names."""


def hit(rule: str, index: int | None = None, **values: object) -> Hit:
    """Return that `rule` holds at the item `index`, with `values` for its texts."""
    return rule, index, values


Hits: TypeAlias = Iterable[Hit]
Checker: TypeAlias = Callable[["ValidationContext"], Hits]


CHECKS: list[Checker] = []
"""The functions that find where rules hold, for any vehicle: the rules say which it is about."""


def checks(check: Checker) -> Checker:
    """Make a function one of `CHECKS`."""
    CHECKS.append(check)
    return check


def count_of(findings: Sequence[Finding], level: Level) -> str:
    """Return how many of `findings` are of `level`, as in "2 errors"."""
    return counted(sum(finding.level is level for finding in findings), level)


def by_rule(findings: Sequence[Finding]) -> Iterator[list[Finding]]:
    """Yield the findings with those of one rule together, in the order of the first of each."""
    groups: dict[str, list[Finding]] = {}
    for finding in findings:
        groups.setdefault(finding.rule, []).append(finding)
    yield from groups.values()


def line_of(group: Sequence[Finding]) -> str:
    """Return the findings of one rule in a line: level, items, what is the case, the rule."""
    return f"{group[0].level}: {said_of(group)}"


def said_of(group: Sequence[Finding]) -> str:
    """Return the line of `line_of` without the level; runs of items as `4-9`."""
    items = sorted({finding.item for finding in group if finding.item is not None})
    runs = []
    for _, run in groupby(enumerate(items), lambda pair: pair[1] - pair[0]):
        first, *rest = (item for _, item in run)
        runs.append(f"{first}-{rest[-1]}" if rest else str(first))
    if len(runs) > _MAX_RUNS_SHOWN:
        runs[_MAX_RUNS_SHOWN:] = ["..."]
    where = f"item{'s' if len(items) > 1 else ''} {', '.join(runs)}: " if items else ""
    return f"{where}{message_of(group)} [{group[0].rule}]"


def message_of(group: Sequence[Finding]) -> str:
    """Return the message of the first of `group`, and how many more there are."""
    more = f" (and {len(group) - 1} more like it)" if len(group) > 1 else ""
    return group[0].message + more
