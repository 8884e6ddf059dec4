"""What a rule is and finds, and how the modules of rules list theirs."""

from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import partialmethod
from typing import TYPE_CHECKING, Any, TypeAlias

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.dialect import name_of
from faao_mav.mission.item import MissionItem

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


@dataclass(frozen=True, slots=True)
class Issue:
    """Where a rule holds: at the index of an item in `Mission.items`, or at none.

    `says` and `do` are what the finding says and what to do; "" for the rule's own.
    """

    index: int | None = None
    says: str = ""
    do: str = ""


Hit: TypeAlias = int | tuple[Any, ...] | None
Check: TypeAlias = Callable[["ValidationContext"], Iterable[Issue]]


@dataclass(frozen=True, slots=True)
class Rule:
    """One thing that is checked.

    `id` is short and stays the same from version to version. `summary` says in a line what is
    wrong when the rule speaks, and `do` what to do about it. `source` names where the rule comes
    from: a function or document of the autopilot with its version, a measurement, or the limits
    that were set. `autopilot` and `kind` are the autopilot and the type of vehicle that it is
    about, None: all.
    """

    id: str
    level: Level
    summary: str
    do: str
    source: str
    check: Check
    autopilot: str | None = None
    kind: str | None = None

    def applies_to(self, vehicle: Vehicle) -> bool:
        """Say whether the rule is about `vehicle`."""
        return self.autopilot in (None, vehicle.autopilot) and self.kind in (None, vehicle.kind)

    def findings(self, context: "ValidationContext") -> Iterator[Finding]:
        """Yield what the rule finds in `context`."""
        for found in self.check(context):
            item = None if found.index is None else found.index + 1
            yield Finding(
                self.level, self.id, item, found.says or self.summary, found.do or self.do
            )


class Rules(list[Rule]):
    """The rules of one module, in order; all about the `autopilot`, if given."""

    def __init__(self, autopilot: str | None = None) -> None:
        super().__init__()
        self._autopilot = autopilot

    def add(
        self,
        level: Level,
        name: str,
        source: str,
        do: str = "",
        *,
        summary: str = "",
        kind: str | None = None,
    ) -> Callable[[Check], Check]:
        """Return a decorator that makes a rule of a check; for the arguments see `Rule`.

        The check's docstring is the summary; `{NAME}` in it is a constant of the check's module.
        """

        def register(check: Check) -> Check:
            self.append(
                Rule(
                    name,
                    level,
                    summary or _summary_of(check),
                    do,
                    source,
                    check,
                    self._autopilot,
                    kind,
                )
            )
            return check

        return register

    error = partialmethod(add, Level.ERROR)
    warning = partialmethod(add, Level.WARNING)
    note = partialmethod(add, Level.NOTE)

    def commands(
        self,
        level: Level,
        name: str,
        summary: str,
        source: str,
        commands: Container[int],
        message: str,
        action: str,
        *,
        where: Callable[[MissionItem], bool] = lambda _: True,
        kind: str | None = None,
    ) -> None:
        """Add a rule about each item with one of `commands` for which `where` holds.

        In `message`, `{name}` is the command, `{item}` the item and `{kind}` the type of vehicle.
        """

        def check(context: "ValidationContext") -> Iterator[Issue]:
            for index, item in enumerate(context.items):
                if item.command in commands and where(item):
                    told = {"name": name_of(item.command), "kind": context.vehicle.kind}
                    yield Issue(index, message.format(item=item, **told), action)

        self.add(level, name, source, summary=summary, kind=kind)(check)

    def where(
        self,
        level: Level,
        name: str,
        summary: str,
        do: str,
        source: str,
        where: Callable[["ValidationContext"], Iterable[Hit]],
        says: str = "",
        *,
        kind: str | None = None,
    ) -> None:
        """Add a rule that holds at the hits of `where`; for the other arguments see `Rule`.

        A hit is the index of an item, or that and values to put into `says` and `do`.
        """

        def check(context: "ValidationContext") -> Iterator[Issue]:
            for hit in where(context):
                index, *values = hit if isinstance(hit, tuple) else (hit,)
                yield Issue(index, says.format(*values), do.format(*values))

        self.append(Rule(name, level, summary, do, source, check, self._autopilot, kind))

    error_where = partialmethod(where, Level.ERROR)
    warning_where = partialmethod(where, Level.WARNING)
    note_where = partialmethod(where, Level.NOTE)


def _summary_of(check: Check) -> str:
    """Return the docstring of `check` as the end of a sentence: "A leg." becomes "a leg"."""
    told = (check.__doc__ or "").removesuffix(".").format_map(check.__globals__)
    first = told.partition(" ")[0]
    return told[:1].lower() + told[1:] if first[1:].islower() or len(first) == 1 else told
