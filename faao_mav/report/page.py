"""One flight as one HTML page that needs nothing but itself."""

import platform
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING

from faao_mav.plan.yaml_text import shown
from faao_mav.report.debrief import FromLog
from faao_mav.report.style import inline_svg
from faao_mav.report.summary import Line, check_lines, result_lines
from faao_mav.validate import Check, Finding
from faao_mav.validate.rule import by_rule, said_of
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

    >>> from faao_mav import Vehicle, check, read_mission
    >>> mission = read_mission("tests/data/missions/plain.waypoints")
    >>> render_report(check(mission, Vehicle()), title="Plain").splitlines()[0]
    '<!doctype html>'
    """
    if not title and isinstance(about, Result):
        title = about.solution.plan.name
    return page(title or "Relay flight", "\n".join(_sections(about)))


def page(title: str, content: str) -> str:
    """Return a whole page of sections, offline, for light, dark, phone and paper."""
    title = escape(title)
    made_by = [
        *(f"{name} {version(name)}" for name in _PARTS),
        f"Python {platform.python_version()}",
    ]
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
<footer>{escape(", ".join(made_by))}</footer>
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
    for name, heading, figure, title in _figures(judged, check, result, log):
        yield figure_section(name, heading, figure, title)
    if result is not None:
        solution = result.solution
        if len(solution.starts) > 1:
            ranked = sorted(solution.starts.items(), key=lambda start: -start[1])
            head = ("start", f"{solution.plan.radio.maximised}, bit/s/Hz")
            yield section("Starts", _table(head, [(name, f"{rate:.4f}") for name, rate in ranked]))
        yield section("Plan", f"<pre>{escape(shown(solution.plan.text))}</pre>", "wide text")


def _figures(
    judged: Check | None, check: Check | None, result: Result | None, log: FromLog | None
) -> "Iterator[tuple[str, str, Figure, str]]":
    """Yield name, heading, figure and title of each: of a mission by itself, and of a plan."""
    from faao_mav.report import figures
    from faao_mav.report.maps import mission_map

    if judged is not None and (track := judged.track) is not None:
        title = "Map of the predicted flight with the mission's items and its fence, metres"
        yield "mission-map", "Mission", mission_map(judged.mission, track), title
        title = "Predicted ground speed and height above home over time"
        yield "mission-motion", "Flight", figures.mission_motion(track), title
    if check is not None and check.energy is not None:
        what = "energy that is used" if check.energy.battery is None else "energy that is left"
        title = f"Power of the whole predicted flight over time, and the {what}"
        yield "energy", "Energy", figures.energy(check.energy), title
    if result is None:
        return
    solution, conversion, prediction = result.solution, result.conversion, result.prediction
    plan, flown = solution.plan, log.found.flown if log is not None else None
    (east, north), (to_east, to_north) = plan.flight.start, plan.flight.end
    title = (
        f"Map of the route from ({east:g}, {north:g}) to ({to_east:g}, {to_north:g}), east and "
        "north in metres, coloured by speed, with stations, waypoints by item number, flights and "
        "the fence"
    )
    yield "route", "Route", figures.route_figure(solution, conversion, flown), title
    if log is not None:
        title = "Distance from the planned place at equal times, as predicted and as flown"
        found = log.found
        yield "apart", "Off the plan", figures.apart(solution, found.predicted, found.flown), title
    title = "Speed and acceleration over time, with their limits"
    yield "motion", "Motion", figures.motion(solution, conversion), title
    title = "Rates of both links over time"
    yield "rates", "Link", figures.rates(solution, prediction, flown), title
    half = ", both hops sharing each slot" if plan.radio.duplex == "half" else ""
    title = f"What the relay has received and not yet forwarded, over time{half}"
    yield "queue", "Queue", figures.queue(solution, prediction, flown), title
    if (under := result.shadowed) is not None:
        title = f"What has arrived over time, as {plan.radio.maximised} counts it: planned without "
        title += "shadowing; with it the median, and in the band eight of ten, one above, one below"
        yield "arrival", "What arrives", figures.arrival(solution, under), title
    first, last = solution.history[0], solution.history[-1]
    title = f"{plan.radio.maximised} after each iteration, from {first:.4f} to {last:.4f} bit/s/Hz"
    yield "convergence", "Convergence", figures.convergence(solution), title
    title = "Power on each stream over time, base station and UAV, strongest stream first"
    yield "power", "Precoders", figures.precoder_power(solution), title


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
