"""A result in words: the text that the main job prints."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from faao_mav.report.flights import flight_lines
from faao_mav.report.found import found_lines
from faao_mav.report.lines import Line, joined
from faao_mav.schedule.precoder_table import taken_by
from faao_mav.validate import Level
from faao_mav.validate.words import by_rule, count_of, line_of
from faao_mav.workflow import Result


def summary(
    result: Result, written: Sequence[Path] = (), precoder_table: Path | None = None
) -> str:
    """Return the text that the main job prints: `result`, and the files that were `written`.

    Of a `precoder_table` among them it says which rows a late aircraft takes.
    """
    lines = [*result_lines(result), *_checked(result)]
    rows = f": a late aircraft takes the row of the {taken_by(result.solution.plan)}"
    lines += [("written", f"{path}{rows if path == precoder_table else ''}") for path in written]
    if not written:
        lines.append(("written", "nothing: give --out MISSION.waypoints"))
    name = result.solution.plan.name
    return "\n".join([*([name] if name else []), joined(lines)])


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
    told = [finding for finding in findings if finding.level is not Level.NOTE]
    levels = (Level.ERROR, Level.WARNING) if told else ()
    counts = [count_of(findings, level) for level in levels] or ["no errors or warnings"]
    yield "checked", ", ".join([*counts, count_of(findings, Level.NOTE)])
    for group in by_rule(told):
        yield "", line_of(group)
    if parameters := result.conversion.parameters:
        wanted = ", ".join(f"{name} {value:g}" for name, value in parameters.items())
        yield "parameters", f"the mission is timed for {wanted}: load them first"
