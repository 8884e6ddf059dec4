"""What a rule is and finds; the table of all rules, and how modules give the checks of its rows."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from importlib.resources import files
from typing import TYPE_CHECKING, TypeAlias

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.dialect import name_of

if TYPE_CHECKING:
    from faao_mav.validate.context import ValidationContext


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
    """

    level: Level
    rule: str
    item: int | None
    message: str
    action: str


Hit: TypeAlias = tuple[int | None, dict[str, object]]
"""Where a rule holds: the index of an item in `Mission.items`, None for none, and the values that
go into the rule's texts, by their names."""


def at(index: int | None = None, **values: object) -> Hit:
    """Return that a rule holds at the item `index`, with `values`."""
    return index, values


Hits: TypeAlias = Iterable[Hit]
Check: TypeAlias = Callable[["ValidationContext"], Hits]


@dataclass(frozen=True, slots=True)
class Rule:
    """One thing that is checked.

    `id` is short and stays the same from version to version. `autopilot` and `kind` are the
    autopilot and the type of vehicle that it is about, None: all. `summary` says in a line what is
    wrong when the rule speaks. `says` is that with the values of a hit, "" where there are none,
    and `do` what to do about it; a name in braces stands for a value of the hit, the `item` there
    or its `command`, the `vehicle`, or a constant of the check's module. `source` names where the
    rule comes from: a function or document of the autopilot with its version, a measurement, or
    the limits that were set.
    """

    level: Level
    id: str
    autopilot: str | None
    kind: str | None
    summary: str
    says: str
    do: str
    source: str
    check: Check

    def applies_to(self, vehicle: Vehicle) -> bool:
        """Say whether the rule is about `vehicle`."""
        return self.autopilot in (None, vehicle.autopilot) and self.kind in (None, vehicle.kind)

    def findings(self, context: "ValidationContext") -> Iterator[Finding]:
        """Yield what the rule finds in `context`."""
        for index, values in self.check(context):
            about: dict[str, object] = {"vehicle": context.vehicle}
            if index is not None:
                item = context.items[index]
                about |= {"item": item, "command": name_of(item.command)}
            told = self.check.__globals__ | about | values
            says, do = (text.format_map(told) for text in (self.says or self.summary, self.do))
            yield Finding(self.level, self.id, None if index is None else index + 1, says, do)


class Checks(dict[str, Check]):
    """The checks of one module, by the rules' ids: an instance decorates them."""

    def __call__(self, rule: str) -> Callable[[Check], Check]:
        """Return a decorator that makes a function the check of `rule`."""

        def register(check: Check) -> Check:
            self[rule] = check
            return check

        return register


def rules_of(checks: Mapping[str, Check]) -> Iterator[Rule]:
    """Yield the rules of the table beside this module, each with its check; "-" is nothing."""
    table = files("faao_mav.validate").joinpath("rules.tsv").read_text(encoding="utf-8")
    for row in table.splitlines()[1:]:
        level, name, *rest = row.split("\t")
        autopilot, kind, summary, says, do, source = ("" if each == "-" else each for each in rest)
        check = checks[name]
        summary = summary.format_map(check.__globals__)
        whose = (autopilot or None, kind or None)
        yield Rule(Level(level), name, *whose, summary, says, do, source, check)
