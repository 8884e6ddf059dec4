"""Findings of a validation in words, those of one rule together."""

from collections.abc import Iterator, Sequence
from itertools import groupby

from faao_mav.validate import Finding, Level

_MAX_RUNS_SHOWN = 8
"""Runs of item numbers that are named in one line; chosen: about a line of a terminal."""


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
    """Return the line of `line_of` without the level."""
    numbers = items_of(group)
    plural = "" if numbers.isdigit() else "s"
    where = f"item{plural} {numbers}: " if numbers else ""
    return f"{where}{message_of(group)} [{group[0].rule}]"


def message_of(group: Sequence[Finding]) -> str:
    """Return the message of the first of `group`, and how many more there are."""
    more = f" (and {len(group) - 1} more like it)" if len(group) > 1 else ""
    return group[0].message + more


def items_of(group: Sequence[Finding]) -> str:
    """Return the items' numbers, runs as `4-9`; nothing where it is about no item."""
    numbers = sorted({finding.item for finding in group if finding.item is not None})
    shown = []
    for _, run in groupby(enumerate(numbers), lambda pair: pair[1] - pair[0]):
        first, *rest = (number for _, number in run)
        shown.append(f"{first}-{rest[-1]}" if rest else str(first))
    if len(shown) > _MAX_RUNS_SHOWN:
        shown[_MAX_RUNS_SHOWN:] = ["..."]
    return ", ".join(shown)


def counted(number: int, noun: str) -> str:
    """Return "1 area" or "2 areas".

    >>> counted(1, "area"), counted(0, "area")
    ('1 area', '0 areas')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
