"""What a validation found, and the rules, for people and for programs."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from faao_mav.cli.finding_lines import count_of, grouped, items_of, line_of, message_of
from faao_mav.validate import Level, Rule
from faao_mav.validate.check import Check
from faao_mav.vehicle import Vehicle, caveat

_COLOURS = {Level.ERROR: "bold red", Level.WARNING: "yellow", Level.NOTE: "cyan"}


@dataclass(frozen=True, slots=True)
class Verdict:
    """A validation of the mission in the file `source`.

    `chosen_by` says what told the autopilot and the kind of vehicle.
    """

    source: Path
    items: int
    vehicle: Vehicle
    chosen_by: str
    check: Check


def as_dict(verdict: Verdict) -> dict[str, Any]:
    """Return the JSON object of `--json`; seconds, metres, bit/s/Hz."""
    check = verdict.check
    return {
        "mission": str(verdict.source),
        "items": verdict.items,
        "autopilot": verdict.vehicle.autopilot,
        "type": verdict.vehicle.kind,
        "parameters": verdict.vehicle.source if verdict.vehicle.parameters else None,
        "predicted": (
            {
                "duration": float(check.track.t[-1]),
                "calibrated": not caveat(verdict.vehicle),
            }
            if check.track
            else None
        ),
        "link": asdict(check.link) | {"share": check.link.share} if check.link else None,
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


def show(verdict: Verdict, console: Console) -> None:
    """Print what was found: a table on a terminal, else one line a finding."""
    _line(console, _head(verdict))
    findings = verdict.check.findings
    if findings and console.is_terminal:
        table = Table(box=None, pad_edge=False, header_style="dim")
        for column in ("item", "rule", "what is the case, and what to do"):
            table.add_column(column, justify="right" if column == "item" else "left")
        for group in grouped(findings):
            colour = _COLOURS[group[0].level]
            table.add_row(
                items_of(group),
                f"[{colour}]{group[0].level}[/]\n{group[0].rule}",
                f"{escape(message_of(group))}\n[green]{escape(group[0].action)}[/]",
            )
        console.print(table)
    else:
        for group in grouped(findings):
            _line(console, f"{line_of(group)}\n    to do: {group[0].action}")
    _line(console, _tail(verdict))


def show_rules(rules: Sequence[Rule], console: Console) -> None:
    """Print the rules: a table on a terminal, else one line a rule."""
    if not console.is_terminal:
        for rule in rules:
            _line(
                console,
                f"{rule.level}\t{rule.id}\t{_whom(rule)}\t{rule.summary}\t{rule.source}",
            )
        return
    table = Table(box=None, pad_edge=False, header_style="dim")
    for column in ("level", "rule", "for", "what is wrong", "source"):
        table.add_column(column)
    for rule in rules:
        level = f"[{_COLOURS[rule.level]}]{rule.level}[/]"
        table.add_row(level, rule.id, _whom(rule), escape(rule.summary), escape(rule.source))
    console.print(table)


def _head(verdict: Verdict) -> str:
    vehicle = verdict.vehicle
    lines = [
        f"{verdict.source}: {verdict.items} items, for {vehicle.type.family.name} and a "
        f"{vehicle.kind} ({verdict.chosen_by}); parameters: "
        f"{vehicle.source if vehicle.parameters else 'defaults'}"
    ]
    check = verdict.check
    if check.track is None:
        lines.append(f"flight not predicted: {check.unpredicted}")
    else:
        doubt = caveat(vehicle)
        lines.append(f"predicted flight: {check.track.t[-1]:.0f} s{f' ({doubt})' if doubt else ''}")
    if check.link is not None:
        lines.append(
            f"predicted link: {check.link.predicted_rate:.4f} bit/s/Hz, "
            f"{100 * check.link.share:.2f} % of the plan's {check.link.planned_rate:.4f}"
        )
    return "\n".join(lines)


def _tail(verdict: Verdict) -> str:
    return ", ".join(count_of(verdict.check.findings, level) for level in Level)


def _whom(rule: Rule) -> str:
    return " ".join(filter(None, (rule.autopilot, rule.kind))) or "all"


def _line(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)
