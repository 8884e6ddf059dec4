"""One flight as one HTML page that needs nothing but itself."""

import html
import platform
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING

from faao_mav.mission.item import Mission
from faao_mav.report.data import ReportData
from faao_mav.report.inline_svg import inline_svg
from faao_mav.validate.finding import Finding
from faao_mav.vehicle import caveat, modelled
from faao_mav.vehicle.track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from faao_mav.optimizer.solution import Solution

_POLICY = "default-src 'none'; style-src 'unsafe-inline'"
_PARTS = ("faao-mav", "numpy", "scipy", "matplotlib")


def render_report(data: ReportData) -> str:
    """Return the page: whole, offline, for light, dark, phone and paper.

    A part of `data` that is not there leaves its sections out. The same data gives the same text.
    """
    plan = data.solution.plan if data.solution is not None else None
    title = html.escape(data.title or (plan.name if plan else "") or "Relay flight")
    style = files("faao_mav.report").joinpath("page.css").read_text(encoding="utf-8")
    sections = "\n".join(_sections(data))
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
{sections}
</main>
<footer>{html.escape(_versions())}</footer>
</body>
</html>
"""


def _sections(data: ReportData) -> Iterator[str]:
    facts = list(_facts(data))
    if facts:
        listed = "".join(
            f"<div><dt>{html.escape(name)}</dt><dd>{html.escape(value)}</dd></div>"
            for name, value in facts
        )
        yield _section("Result", f"<dl>{listed}</dl>", "wide")
    if data.findings is not None:
        yield _section("Findings", _findings(data.findings), "wide")
    if data.conversion is not None and data.conversion.parameters:
        rows = [(name, f"{value:g}") for name, value in data.conversion.parameters.items()]
        told = "<p>The mission is timed for these: load them first.</p>"
        yield _section("Parameters", told + _table(("parameter", "value"), rows))
    if data.mission is not None and data.track is not None:
        yield from _flown(data.mission, data.track)
    if data.solution is not None:
        yield from _drawn(data, data.solution)
        plan = f"<pre>{html.escape(data.solution.plan.text)}</pre>"
        yield _section("Plan", plan, "wide text")


def _facts(data: ReportData) -> Iterator[tuple[str, str]]:
    """What a reader looks for first."""
    solution, prediction = data.solution, data.prediction
    if solution is not None:
        rates = solution.rates
        yield "planned rate", f"{rates.R_avg:.4f} bit/s/Hz"
        yield "at the start of the optimiser", f"{solution.history[0]:.4f} bit/s/Hz"
        yield "base station to UAV", f"{rates.R_U:.4f} bit/s/Hz"
        yield "UAV to user", f"{rates.R_G:.4f} bit/s/Hz"
        yield "optimiser", f"{'converged' if solution.converged else 'NOT CONVERGED'}"
        yield "planned duration", f"{solution.plan.flight.duration:g} s"
    yield from _priced(data)
    if prediction is not None:
        yield from _predicted(
            f"{prediction.rates.R_avg:.4f} bit/s/Hz",
            prediction.duration,
            prediction.rms_position_error,
            prediction.max_position_error,
            prediction.max_path_error,
        )
    if data.link is not None:
        link = data.link
        yield from _predicted(
            f"{link.predicted_rate:.4f} bit/s/Hz, {100 * link.share:.2f} %",
            link.predicted_duration,
            link.rms_position_error,
            link.max_position_error,
            link.path_error,
        )
    if data.vehicle is not None and modelled(data.vehicle) and (doubt := caveat(data.vehicle)):
        yield "predicted", doubt
    if data.mission is not None:
        yield "mission items", str(len(data.mission.items))
    if data.track is not None:
        yield "predicted flight, take-off to end", f"{data.track.t[-1]:.0f} s"
    if data.conversion is not None:
        yield "mission items", str(len(data.conversion.mission.items))
        yield "relay route", f"{data.conversion.schedule.route.distance:.0f} m"


def _predicted(
    rate: str, duration: float, rms: float, most: float, path: float
) -> Iterator[tuple[str, str]]:
    """What the predicted relay flight makes of the plan: s, m."""
    yield "predicted rate", rate
    yield "predicted duration of the relay flight", f"{duration:.1f} s"
    yield "from the plan at equal times, rms", f"{rms:.1f} m"
    yield "the same, at most", f"{most:.1f} m"
    yield "from the planned path, at most", f"{path:.1f} m"


def _priced(data: ReportData) -> Iterator[tuple[str, str]]:
    """What the plan is worth by other measures than its own."""
    if data.information is not None:
        information = data.information
        yield (
            "mutual information",
            f"{information.average:.3f} ± {information.error:.1g} bit/s/Hz",
        )
    if data.fresh is not None:
        fresh = data.fresh
        yield (
            "on fading that was not planned on",
            f"{fresh.average:.4f} ± {fresh.error:.1g} bit/s/Hz",
        )
    if data.saturation is not None:
        limit = data.saturation
        yield "at most, by the alphabet", f"{limit.ceiling:g} bit/s/Hz"
        if limit.saturated:
            yield "saturated", f"{limit.spare_db:.1f} dB less power would do"
    if data.bound is not None:
        kind = "" if data.bound.exact else " (numerical)"
        yield "no route can exceed", f"{data.bound.value:.4f} bit/s/Hz{kind}"


def _findings(findings: Sequence[Finding]) -> str:
    if not findings:
        return "<p>None: nothing speaks against the mission.</p>"
    items = []
    for finding in findings:
        where = "" if finding.item is None else f" (item {finding.item})"
        text = html.escape(f"{finding.message}{where} [{finding.rule}]")
        todo = f"<br>{html.escape(finding.action)}" if finding.action else ""
        level = html.escape(finding.level)
        items.append(f'<li class="{level}"><b>{level}</b>: {text}{todo}</li>')
    return f"<ul>{''.join(items)}</ul>"


def _flown(mission: Mission, track: Track) -> Iterator[str]:
    """Yield the figures of a mission that is judged by itself."""
    from faao_mav.report.mission_figures import mission_map, mission_motion

    title = "Map of the predicted flight with the mission's items and its fence, metres"
    yield _figure("mission-map", "Mission", mission_map(mission, track), title)
    title = "Predicted ground speed and height above home over time"
    yield _figure("mission-motion", "Flight", mission_motion(track), title)


def _drawn(data: ReportData, solution: "Solution") -> Iterator[str]:
    """Yield the sections that are figures."""
    from faao_mav.report import figures

    vehicle, conversion, prediction = solution.plan.vehicle, data.conversion, data.prediction
    start, end = solution.plan.flight.start, solution.plan.flight.end
    yield _figure(
        "route",
        "Route",
        figures.route(solution, conversion),
        f"Map of the route from {_place(start)} to {_place(end)}, east and north in metres, "
        "coloured by speed, with both stations"
        + (", waypoints by item number and the predicted track" if conversion else ""),
    )
    yield _figure(
        "motion",
        "Motion",
        figures.motion(solution, conversion),
        f"Speed over time, limit {vehicle.max_speed:g} m/s, and acceleration over time, limit "
        f"{vehicle.max_acceleration:g} m/s²",
    )
    yield _figure(
        "rates",
        "Link",
        figures.rates(solution, prediction),
        "Rates of both links over time, planned"
        + (" and along the predicted flight" if prediction else ""),
    )
    yield _figure(
        "convergence",
        "Convergence",
        figures.convergence(solution),
        f"Rate after each iteration, from {solution.history[0]:.4f} to {solution.history[-1]:.4f} "
        f"bit/s/Hz; ended: {solution.ending}",
    )
    yield _figure(
        "power",
        "Precoders",
        figures.precoder_power(solution),
        "Power on each stream over time, base station and UAV, strongest stream first",
    )
    if len(solution.starts) > 1:
        ranked = sorted(solution.starts.items(), key=lambda start: -start[1])
        rows = [(name, f"{rate:.4f}") for name, rate in ranked]
        yield _section("Starts", _table(("start", "R_avg, bit/s/Hz"), rows))


def _figure(name: str, heading: str, figure: "Figure", title: str) -> str:
    return _section(heading, inline_svg(figure, name, title) + f"<p>{html.escape(title)}.</p>")


def _section(heading: str, content: str, kind: str = "") -> str:
    marked = f' class="{kind}"' if kind else ""
    return f"<section{marked}>\n<h2>{heading}</h2>\n{content}\n</section>"


def _table(head: tuple[str, str], rows: Sequence[tuple[str, str]]) -> str:
    names = "".join(f"<th>{html.escape(name)}</th>" for name in head)
    lines = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>"
        for name, value in rows
    )
    return f"<table><thead><tr>{names}</tr></thead><tbody>{lines}</tbody></table>"


def _place(position: tuple[float, float]) -> str:
    return f"({position[0]:g}, {position[1]:g})"


def _versions() -> str:
    parts = [f"{name} {version(name)}" for name in _PARTS]
    return ", ".join([*parts, f"Python {platform.python_version()}"])
