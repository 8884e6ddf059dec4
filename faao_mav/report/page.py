"""One flight as one HTML page that needs nothing but itself."""

import platform
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

from faao_mav.files import write_whole
from faao_mav.optimizer.solution import save_solution
from faao_mav.plan.yaml_text import shown as text_of
from faao_mav.report.debrief import FromLog
from faao_mav.report.figures import flight_figure, mission_figures, plan_figures
from faao_mav.report.style import inline_svg, save_figure
from faao_mav.report.summary import Line, check_lines, result_lines
from faao_mav.schedule.precoder_table import precoder_table
from faao_mav.validate import Check, Finding
from faao_mav.validate.rule import by_rule, said_of
from faao_mav.workflow import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def render_report(about: Result | Check | FromLog, *, title: str = "") -> str:
    """Return the page about a planned flight, a mission that was checked, or a flight in a log.

    A part that a `Result` does not have leaves its sections out. The title is the plan's name
    unless one is given. The same flight gives the same text.

    >>> from faao_mav import Vehicle, check, read_mission
    >>> mission = read_mission("tests/data/missions/plain.waypoints")
    >>> render_report(check(mission, Vehicle()), title="Plain").splitlines()[0]
    '<!doctype html>'
    """
    if not title and isinstance(about, Result):
        title = about.solution.plan.name
    return page(title or "Relay flight", "\n".join(_sections(about)))


def write_part(result: Result, part: str, path: Path) -> None:
    """Write the `part` "save", "precoders", "report" or "figure" of `result` to the file `path`.

    Raises `InputError` where it cannot be written, and for precoders that are no table.
    """
    solution, conversion = result.solution, result.conversion
    if part == "save":
        save_solution(solution, path, conversion.schedule.track() if conversion else None)
    elif part == "figure":
        save_figure(flight_figure(solution, conversion, result.prediction), path)
    else:
        text = render_report(result) if part == "report" else precoder_table(solution)
        write_whole(path, text.encode())


def page(title: str, content: str) -> str:
    """Return a whole page of sections, offline, for light, dark, phone and paper.

    Its Content-Security-Policy allows its own style, and nothing from elsewhere.
    """
    packages = ("faao-mav", "numpy", "scipy", "matplotlib")
    made_by = [f"{name} {version(name)}" for name in packages]
    made_by.append(f"Python {platform.python_version()}")
    html, style = (
        files("faao_mav.report").joinpath(name).read_text(encoding="utf-8")
        for name in ("page.html", "page.css")
    )
    told = {"title": escape(title), "made_by": escape(", ".join(made_by))}
    return Template(html).substitute(told, style=style, content=content)


def _sections(about: Result | Check | FromLog) -> Iterator[str]:
    log = about if isinstance(about, FromLog) else None
    planned = about.result if isinstance(about, FromLog) else about
    result = planned if isinstance(planned, Result) else None
    check = planned if isinstance(planned, Check) else planned.check
    lines = list(result_lines(result, timed=False)) if result else []
    # the check of a mission that was made from the plan says the same as the conversion
    judged = check if check is not None and not (result and result.conversion) else None
    if judged is not None:
        lines += [("mission items", str(len(judged.mission.items))), *check_lines(judged)]
    if log is not None:
        yield section("Flown", facts(log.lines()), "wide")
    yield section("Result" if log is None else "Planned", facts(lines), "wide")
    if check is not None:
        yield section("Findings", _findings(check.findings), "wide")
    if result is not None and result.conversion is not None and result.conversion.parameters:
        wanted = ((name, f"{value:g}") for name, value in result.conversion.parameters.items())
        told = "<p>The mission is timed for these: load them first.</p>"
        yield section("Parameters", told + facts(wanted))
    if check is not None:
        for shown in mission_figures(check, alone=judged is not None):
            yield figure_section(*shown)
    if result is not None:
        for shown in plan_figures(result, log):
            yield figure_section(*shown)
        yield section(
            "Plan", f"<pre>{escape(text_of(result.solution.plan.text))}</pre>", "wide text"
        )


def facts(lines: Iterable[Line]) -> str:
    """Return labelled lines as a list."""
    facts = "".join(
        (f"<dt>{escape(label)}</dt>" if label else "")
        + f"<dd>{escape(text.replace(' +- ', ' ± '))}</dd>"
        for label, text in lines
    )
    return f"<dl>{facts}</dl>"


def _findings(findings: Sequence[Finding]) -> str:
    if not findings:
        return "<p>None: nothing speaks against the mission.</p>"
    items = []
    for group in by_rule(findings):
        level, action = group[0].level, group[0].action
        todo = f"<br>{escape(action)}" if action else ""
        items.append(f'<li class="{level}"><b>{level}</b>: {escape(said_of(group))}{todo}</li>')
    return f"<ul>{''.join(items)}</ul>"


def figure_section(heading: str, figure: "Figure", title: str) -> str:
    """Return a figure under its heading, with what it shows below."""
    name = heading.lower().replace(" ", "-")
    return section(heading, inline_svg(figure, name, title) + f"<p>{escape(title)}.</p>")


def section(heading: str, content: str, kind: str = "") -> str:
    """Return a section under its heading; its `kind` are classes of the style."""
    marked = f' class="{kind}"' if kind else ""
    return f"<section{marked}>\n<h2>{heading}</h2>\n{content}\n</section>"
