"""One flight as one HTML page that needs nothing but itself."""

import platform
from collections.abc import Iterator, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING

from faao_mav.report.debrief import FromLog
from faao_mav.report.style import inline_svg
from faao_mav.report.summary import Line, check_lines, result_lines
from faao_mav.validate import Finding
from faao_mav.validate.check import Check
from faao_mav.validate.flown import Debriefing
from faao_mav.validate.words import by_rule, said_of
from faao_mav.workflow import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POLICY = "default-src 'none'; style-src 'unsafe-inline'"
"""The page's Content-Security-Policy: its own style, and nothing from elsewhere."""

_PARTS = ("faao-mav", "numpy", "scipy", "matplotlib")
"""The packages whose versions the page names."""


def render_report(about: Result | Check | FromLog, *, title: str = "") -> str:
    """Return the page about a planned flight, a mission that was checked, or a flight in a log.

    A part that a `Result` does not have leaves its sections out. The title is the plan's name
    unless one is given. The same flight gives the same text.
    """
    if not title and isinstance(about, Result):
        title = about.solution.plan.name
    return page(title or "Relay flight", "\n".join(_sections(about)))


def page(title: str, content: str) -> str:
    """Return a whole page of sections, offline, for light, dark, phone and paper."""
    title = escape(title)
    style = files("faao_mav.report").joinpath("page.css").read_text(encoding="utf-8")
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<h1>{title}</h1>
<main>
{content}
</main>
<footer>{escape(_versions())}</footer>
</body>
</html>
"""


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
        rows = [(name, f"{value:g}") for name, value in result.conversion.parameters.items()]
        told = "<p>The mission is timed for these: load them first.</p>"
        yield section("Parameters", told + _table(("parameter", "value"), rows))
    if judged is not None:
        yield from _mission_figures(judged)
    if check is not None and check.energy is not None:
        from faao_mav.report.figures import energy

        what = "energy that is used" if check.energy.battery is None else "energy that is left"
        title = f"Power of the whole predicted flight over time, and the {what}"
        yield figure_section("energy", "Energy", energy(check.energy), title)
    if result is not None:
        yield from _plan_figures(result, log.found if log is not None else None)
        text = f"<pre>{escape(result.solution.plan.text)}</pre>"
        yield section("Plan", text, "wide text")


def facts(lines: Sequence[Line]) -> str:
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


def _mission_figures(check: Check) -> Iterator[str]:
    """Yield the figures of a mission that is judged by itself."""
    if check.track is None:
        return
    from faao_mav.report.figures import mission_motion
    from faao_mav.report.maps import mission_map

    title = "Map of the predicted flight with the mission's items and its fence, metres"
    yield figure_section("mission-map", "Mission", mission_map(check.mission, check.track), title)
    title = "Predicted ground speed and height above home over time"
    yield figure_section("mission-motion", "Flight", mission_motion(check.track), title)


def _plan_figures(result: Result, debriefing: Debriefing | None) -> Iterator[str]:
    """Yield the figures of a solved plan, and the table of the optimiser's starts."""
    from faao_mav.report import figures

    plan = result.solution.plan
    solution, conversion, prediction = result.solution, result.conversion, result.prediction
    real = debriefing.flown if debriefing is not None else None
    flight, vehicle, maximised = plan.flight, plan.vehicle, plan.radio.maximised
    title = (
        f"Map of the route from {_place(flight.start)} to {_place(flight.end)}, east and north in "
        "metres, coloured by speed, with both stations"
    )
    if conversion:
        title += ", waypoints by item number and the predicted track"
    if real is not None:
        title += ", and the track that was flown"
    if plan.fence:
        title += "; zones of the fence, and the margin that the plan keeps"
    yield figure_section("route", "Route", figures.route(solution, conversion, real), title)
    if debriefing is not None and real is not None:
        title = "Distance from the planned place at equal times, as predicted and as flown"
        figure = figures.apart(solution, debriefing.predicted, real)
        yield figure_section("apart", "Off the plan", figure, title)
    title = (
        f"Speed over time, limit {vehicle.max_speed:g} m/s, and acceleration over time, limit "
        f"{vehicle.max_acceleration:g} m/s²"
    )
    yield figure_section("motion", "Motion", figures.motion(solution, conversion), title)
    flown = " and along the predicted flight" if prediction else ""
    flown += " and as flown" if real is not None else ""
    title = f"Rates of both links over time, planned{flown}"
    yield figure_section("rates", "Link", figures.rates(solution, prediction, real), title)
    half = ", both hops sharing each slot" if plan.radio.duplex == "half" else ""
    title = f"What the relay has received and not yet forwarded, over time{half}"
    yield figure_section("queue", "Queue", figures.queue(solution, prediction, real), title)
    first, last = solution.history[0], solution.history[-1]
    title = (
        f"{maximised} after each iteration, from {first:.4f} to {last:.4f} bit/s/Hz; "
        f"ended: {solution.ending}"
    )
    yield figure_section("convergence", "Convergence", figures.convergence(solution), title)
    title = "Power on each stream over time, base station and UAV, strongest stream first"
    yield figure_section("power", "Precoders", figures.precoder_power(solution), title)
    if len(solution.starts) > 1:
        ranked = sorted(solution.starts.items(), key=lambda start: -start[1])
        rows = [(name, f"{rate:.4f}") for name, rate in ranked]
        yield section("Starts", _table(("start", f"{maximised}, bit/s/Hz"), rows))


def figure_section(name: str, heading: str, figure: "Figure", title: str) -> str:
    """Return a figure under its heading, with what it shows below."""
    return section(heading, inline_svg(figure, name, title) + f"<p>{escape(title)}.</p>")


def section(heading: str, content: str, kind: str = "") -> str:
    """Return a section under its heading; its `kind` are classes of the style."""
    marked = f' class="{kind}"' if kind else ""
    return f"<section{marked}>\n<h2>{heading}</h2>\n{content}\n</section>"


def _table(head: tuple[str, str], rows: Sequence[tuple[str, str]]) -> str:
    def cells(tag: str, row: tuple[str, str]) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(text)}</{tag}>" for text in row) + "</tr>"

    body = "".join(cells("td", row) for row in rows)
    return f"<table><thead>{cells('th', head)}</thead><tbody>{body}</tbody></table>"


def _place(position: tuple[float, float]) -> str:
    return f"({position[0]:g}, {position[1]:g})"


def _versions() -> str:
    parts = [f"{name} {version(name)}" for name in _PARTS]
    return ", ".join([*parts, f"Python {platform.python_version()}"])
