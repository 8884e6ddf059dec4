"""A result in words: the text that the main job prints."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from faao_mav.report.flights import brief_flight, conditions, flight_lines
from faao_mav.report.found import brief_link, found_lines, remarkable
from faao_mav.report.lines import Line, joined
from faao_mav.schedule.precoder_table import taken_by
from faao_mav.validate import Level
from faao_mav.validate.words import by_rule, count_of, line_of
from faao_mav.workflow import Result


def summary(
    result: Result,
    written: Sequence[Path] = (),
    precoder_table: Path | None = None,
    *,
    verbose: bool = False,
) -> str:
    """Return the text that the main job prints: `result`, and the files that were `written`.

    The first line is for who flies: what arrives, in how long, whether the mission keeps it and
    whether anything is wrong. `verbose` adds what a researcher looks at. Of a `precoder_table`
    among the files it says which rows a late aircraft takes.
    """
    lines = list(result_lines(result) if verbose else _brief(result))
    lines += _checked(result)
    rows = f" (a late aircraft takes the row of the {taken_by(result.solution.plan)})"
    names = ", ".join(f"{path}{rows if path == precoder_table else ''}" for path in written)
    lines.append(("files", names or "none: give --out MISSION.waypoints"))
    return "\n".join([_headline(result), joined(lines)])


def _headline(result: Result) -> str:
    """Return what arrives, in how long, how much of it by the mission, and what is wrong."""
    solution, plan = result.solution, result.solution.plan
    rate, lasting = solution.delivered_rate, f"{plan.flight.duration:g} s"
    megabytes, megabits = plan.megabytes(rate), plan.megabits(rate)
    told = f"delivers {rate:.4f} bit/s/Hz for {lasting}"
    if megabytes is not None:
        told = f"delivers {megabytes:.4g} megabytes in {lasting} ({megabits:.4g} Mbit/s)"
    parts = [f"{plan.name}: {told}" if plan.name else told]
    if result.no_mission is not None:
        parts.append("there is no mission for it")
    elif result.prediction is not None:
        share = result.prediction.delivered_rate / rate if rate else 1.0
        parts += [f"the mission keeps {100 * share:.2f} % of it", _wrong(result)]
    return "; ".join(parts)


def _wrong(result: Result) -> str:
    """Return how many errors and warnings validation found."""
    counts = [
        count_of(result.findings, level)
        for level in (Level.ERROR, Level.WARNING)
        if any(finding.level is level for finding in result.findings)
    ]
    return ", ".join(counts) or "no errors or warnings"


def _brief(result: Result) -> Iterator[Line]:
    yield from brief_link(result)
    yield from remarkable(result)
    yield from brief_flight(result)
    yield from conditions(result)


def result_lines(result: Result, *, timed: bool = True) -> Iterator[Line]:
    """Yield what the optimiser found and how its mission will fly.

    With `timed` it says how long that took, which no two runs have in common.
    """
    yield from found_lines(result, timed=timed)
    yield from flight_lines(result)


def _checked(result: Result) -> Iterator[Line]:
    """Yield what validation found, notes counted and the rest told, and the parameters to load."""
    if result.conversion is None:
        return
    findings = result.findings
    yield "checks", f"{_wrong(result)}, {count_of(findings, Level.NOTE)}"
    for group in by_rule([each for each in findings if each.level is not Level.NOTE]):
        yield "", line_of(group)
    if parameters := result.conversion.parameters:
        wanted = ", ".join(f"{name} {value:g}" for name, value in parameters.items())
        yield "parameters", f"the mission is timed for {wanted}: load them first"
