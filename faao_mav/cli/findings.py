"""What a validation found, and the rules, for people and for programs."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from faao_mav.report.flights import check_lines
from faao_mav.validate import Level, Rule
from faao_mav.validate.check import Check
from faao_mav.validate.words import by_rule, count_of, items_of, line_of, message_of

_COLOURS = {Level.ERROR: "bold red", Level.WARNING: "yellow", Level.NOTE: "cyan"}
"""How a terminal shows each level."""


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A check of the mission in the file `source`.

    `chosen_by` says what told the autopilot and the type of vehicle.
    """

    source: Path
    chosen_by: str
    check: Check


def as_dict(checked: CheckedFile) -> dict[str, Any]:
    """Return the JSON object of `--json`; seconds, metres, bit/s/Hz."""
    check, vehicle = checked.check, checked.check.vehicle
    predicted = None
    if check.track is not None:
        predicted = {"duration": float(check.track.t[-1]), "assumption": vehicle.assumption}
    link = None
    if (found := check.link) is not None:
        link = asdict(found) | {"share": found.share, "predicted_mbytes": found.predicted_mbytes}
    return {
        "mission": str(checked.source),
        "items": len(check.mission.items),
        "autopilot": vehicle.autopilot,
        "type": vehicle.kind,
        "parameters": vehicle.source if vehicle.parameters else None,
        "predicted": predicted,
        "link": link,
        "energy": check.energy.as_dict() if check.energy else None,
        "errors": len(check.of(Level.ERROR)),
        "warnings": len(check.of(Level.WARNING)),
        "notes": len(check.of(Level.NOTE)),
        "findings": [asdict(finding) for finding in check.findings],
    }


def rules_as_dict(rules: Sequence[Rule]) -> dict[str, Any]:
    """Return the JSON object of `--rules --json`; null: every autopilot, every type."""
    return {
        "rules": [
            {
                "id": rule.id,
                "level": rule.level,
                "autopilot": rule.autopilot,
                "type": rule.kind,
                "summary": rule.summary,
                "source": rule.source,
            }
            for rule in rules
        ]
    }


def show(checked: CheckedFile, console: Console) -> None:
    """Print what was found: a table on a terminal, else one line a finding."""
    check, vehicle = checked.check, checked.check.vehicle
    _line(
        console,
        f"{checked.source}: {len(check.mission.items)} items, for "
        f"{vehicle.type.family.name} and a {vehicle.kind} ({checked.chosen_by}); "
        f"parameters: {vehicle.source if vehicle.parameters else 'defaults'}",
    )
    for label, text in check_lines(check):
        if label:  # what goes on without one stands in the findings too
            _line(console, f"{label}: {text}")
    groups = list(by_rule(check.findings))
    if groups and console.is_terminal:
        table = _table("item", "rule", "what is the case, and what to do")
        table.columns[0].justify = "right"
        for group in groups:
            first = group[0]
            table.add_row(
                items_of(group),
                f"{_coloured(first.level)}\n{first.rule}",
                f"{escape(message_of(group))}\n[green]{escape(first.action)}[/]",
            )
        console.print(table)
    else:
        for group in groups:
            to_do = f"\n    to do: {group[0].action}" if group[0].action else ""
            _line(console, f"{line_of(group)}{to_do}")
    _line(console, ", ".join(count_of(check.findings, level) for level in Level))


def show_rules(rules: Sequence[Rule], console: Console) -> None:
    """Print the rules: a table on a terminal, else one line a rule."""
    rows = [
        (
            rule.level,
            rule.id,
            " ".join(filter(None, (rule.autopilot, rule.kind))) or "all",
            rule.summary,
            rule.source,
        )
        for rule in rules
    ]
    if not console.is_terminal:
        for row in rows:
            _line(console, "\t".join(row))
        return
    table = _table("level", "rule", "for", "what is wrong", "source")
    for level, *rest in rows:
        table.add_row(_coloured(Level(level)), *map(escape, rest))
    console.print(table)


def _table(*columns: str) -> Table:
    return Table(*columns, box=None, pad_edge=False, header_style="dim")


def _coloured(level: Level) -> str:
    return f"[{_COLOURS[level]}]{level}[/]"


def _line(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)
