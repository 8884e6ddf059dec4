"""What a validation found, and the rules, as lines and as JSON."""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import typer

from faao_mav.report.summary import check_lines
from faao_mav.validate import Level, Rule
from faao_mav.validate.check import Check
from faao_mav.validate.words import by_rule, count_of, said_of

_COLOURS = {Level.ERROR: "red", Level.WARNING: "yellow", Level.NOTE: "cyan"}
"""How a terminal shows each level."""


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A check of the mission in the file `source`.

    `chosen_by` says what told the autopilot and the type of vehicle.
    """

    source: Path
    chosen_by: str
    check: Check

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of `--json`; seconds, metres, bit/s/Hz."""
        check, vehicle, link = self.check, self.check.vehicle, self.check.link
        predicted = None
        if check.track is not None:
            predicted = {"duration": float(check.track.t[-1]), "assumption": vehicle.assumption}
        more = {} if link is None else {n: getattr(link, n) for n in ("share", "predicted_mbytes")}
        return {
            "mission": str(self.source),
            "items": len(check.mission.items),
            "autopilot": vehicle.autopilot,
            "type": vehicle.kind,
            "parameters": vehicle.source if vehicle.parameters else None,
            "predicted": predicted,
            "link": asdict(link) | more if link is not None else None,
            "energy": check.energy.as_dict() if check.energy else None,
            **{f"{level}s": len(check.of(level)) for level in Level},
            "findings": [asdict(finding) for finding in check.findings],
        }

    def lines(self) -> Iterator[str]:
        """Yield what was found: one line a rule, and one of what to do."""
        check, vehicle = self.check, self.check.vehicle
        yield (
            f"{self.source}: {len(check.mission.items)} items, for "
            f"{vehicle.type.family.name} and a {vehicle.kind} ({self.chosen_by}); "
            f"parameters: {vehicle.source if vehicle.parameters else 'defaults'}"
        )
        for label, text in check_lines(check):
            if label:  # what goes on without one stands in the findings too
                yield f"{label}: {text}"
        for group in by_rule(check.findings):
            yield f"{_coloured(group[0].level)}: {said_of(group)}"
            if group[0].action:
                yield f"    to do: {group[0].action}"
        yield ", ".join(count_of(check.findings, level) for level in Level)


def rules_as_dict(rules: Sequence[Rule]) -> dict[str, Any]:
    """Return the JSON object of `--rules --json`; null: every autopilot, every type."""
    keys = {"id": "id", "level": "level", "autopilot": "autopilot", "type": "kind"}
    keys |= {"summary": "summary", "source": "source"}
    return {"rules": [{key: getattr(r, name) for key, name in keys.items()} for r in rules]}


def rule_lines(rules: Sequence[Rule]) -> Iterator[str]:
    """Yield a line a rule, its parts between tabs."""
    for rule in rules:
        whose = " ".join(filter(None, (rule.autopilot, rule.kind))) or "all"
        yield "\t".join((_coloured(rule.level), rule.id, whose, rule.summary, rule.source))


def _coloured(level: Level) -> str:
    return typer.style(str(level), fg=_COLOURS[level]) if sys.stdout.isatty() else str(level)
