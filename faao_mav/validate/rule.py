"""What a rule is, and how the modules of rules list theirs."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from faao_mav.plan.autopilots import Autopilot, Kind
from faao_mav.validate.finding import Finding, Level
from faao_mav.vehicle import Vehicle

if TYPE_CHECKING:
    from faao_mav.validate.case import Case


@dataclass(frozen=True, slots=True)
class Issue:
    """What a check found, at the index of an item in `Mission.items` or at none."""

    index: int | None
    message: str
    action: str


Check: TypeAlias = Callable[["Case"], Iterable[Issue]]


@dataclass(frozen=True, slots=True)
class Rule:
    """One thing that is checked.

    `id` is short and stays the same from version to version. `summary` says in a line what is
    wrong when the rule speaks. `source` names where the rule comes from: a function or document of
    the autopilot with its version, a measurement, or the limits that were set. `autopilot` and
    `kind` are the vehicles that it is about, None: all.
    """

    id: str
    level: Level
    summary: str
    source: str
    check: Check
    autopilot: Autopilot | None = None
    kind: Kind | None = None

    def applies_to(self, vehicle: Vehicle) -> bool:
        """Say whether the rule is about `vehicle`."""
        return self.autopilot in (None, vehicle.autopilot) and self.kind in (None, vehicle.kind)

    def findings(self, case: "Case") -> Iterator[Finding]:
        """Yield what the rule finds in `case`."""
        for issue in self.check(case):
            item = None if issue.index is None else issue.index + 1
            yield Finding(self.level, self.id, item, issue.message, issue.action)


class Rules(list[Rule]):
    """The rules of one module, in the order of its functions."""

    def add(
        self,
        id: str,  # noqa: A002
        level: Level,
        summary: str,
        source: str,
        *,
        autopilot: Autopilot | None = None,
        kind: Kind | None = None,
    ) -> Callable[[Check], Check]:
        """Return a decorator that makes a rule of a check."""

        def register(check: Check) -> Check:
            self.append(Rule(id, level, summary, source, check, autopilot, kind))
            return check

        return register
