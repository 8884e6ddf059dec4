"""A link that was measured in flight: the fitted law, in lines, as a file and as a page."""

import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import counted
from faao_mav.radio.fit import SPREAD_OF_NO_LAW, LinkFit, seen
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.terrain import free_space_db
from faao_mav.report.style import INK, SERIES, WIDTH, drawing, label, legend_above
from faao_mav.report.summary import Line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = 20.0
"""Residuals, dB, at which the map's colours end: thrice what shadowing leaves. Chosen."""


_LEVELS = 16
"""Colours on that map's scale. Chosen: their steps can hardly be seen."""


_MOST_SHOWN = 2000
"""Means that the page shows at most: a page of a megabyte. Chosen."""


def law_text(fit: LinkFit) -> str:
    """Return the law as a sum, of d, m, and of s, the sine of the elevation.

    >>> from dataclasses import replace
    >>> law_text(LinkFit(-48.5, 2.0, (54.48, -75.2), (), 0, 0, 0, 0, 0, 0, ()))
    '-48.5 - 20 log10 d + 54.5 s - 75.2 s^2 dB'
    """
    text = f"{fit.level:.1f} - {10 * fit.exponent:.3g} log10 d"
    for k, term in enumerate(fit.elevation, 1):
        power = "" if k == 1 else f"^{k}"
        text += f" {'-' if term < 0 else '+'} {abs(term):.1f} s{power}"
    return f"{text} dB"


def link_lines(fit: LinkFit, absolute: bool) -> Iterator[Line]:
    """Yield the law, what it rests on, and what is known of its errors.

    A fit that is not `absolute` has a level within a constant.
    """
    yield "gain", law_text(fit) if absolute else f"{law_text(fit)}, within a constant"
    if not absolute:
        yield (
            "",
            "shape only: the plan's radio.reference_gain_db stands; give --power for the level",
        )
    (near, far), (least, most) = fit.distance_m, fit.elevation_deg
    ranges = f"{near:.0f} to {far:.0f} m away, {least:.0f} to {most:.0f} degrees high"
    yield "measured", f"{ranges}; {_rests_on(fit)}"
    left_out = counted(fit.legs, "leg")
    if fit.heights > 1:
        left_out += f" and {fit.heights} heights"
    if fit.legs == 1:
        yield "", "one leg alone: d^-2 with its level, nothing that could be told from it"
    else:
        told = f"{fit.spread:.1f} dB at {left_out} left out one by one (d^-2: "
        told += f"{fit.paper_spread:.1f}), correlated over {fit.correlation:.0f} m"
        yield "spread", told
        yield "error", f"{fit.error:.1f} dB of the gain where it was flown, one standard error"
    if not fit.holds:
        told = f"of distance and elevation holds: {fit.spread:.1f} dB are left, more than "
        told += f"{SPREAD_OF_NO_LAW:g}. Nothing is promised; raise the station's antenna over what "
        yield "no law", f"{told}stands about it, or fly higher"


def link_record(fit: LinkFit, absolute: bool) -> dict[str, Any]:
    """Return the JSON object of `--json`; errors are null where one leg tells none."""
    error = [x if math.isfinite(x) else None for x in (*fit.errors, fit.error)]
    return {
        "reference_gain_db": fit.level if absolute else None,
        "exponent": fit.exponent,
        "elevation_db": list(fit.elevation),
        "errors": error[:-1],
        "gain_error_db": error[-1],
        "spread_db": fit.spread,
        "paper_spread_db": fit.paper_spread,
        "correlation_m": fit.correlation,
        "elevation_deg": fit.elevation_deg,
        "distance_m": fit.distance_m,
        "holds": fit.holds,
        "means": fit.count,
        "legs": fit.legs,
        "heights": fit.heights,
    }


def link_yaml(fit: LinkFit, absolute: bool) -> str:
    """Return the file that a plan's `gain` names."""
    level = f"reference_gain_db: {fit.level:.2f}\n" if absolute else ""
    terms = ", ".join(f"{term:.2f}" for term in fit.elevation)
    least, most = fit.elevation_deg
    near, far = fit.distance_m
    return (
        f"# {law_text(fit)}: d the distance, m, s the sine of the elevation\n"
        f"about: {json.dumps(_rests_on(fit))}\n"
        f"{level}exponent: {fit.exponent:.3f}\nelevation_db: [{terms}]\n"
        f"spread_db: {fit.spread:.2f}\ncorrelation_m: {fit.correlation:.0f}\n"
        f"elevation_deg: [{least:.1f}, {most:.1f}]\ndistance_m: [{near:.5g}, {far:.5g}]\n"
    )


def map_text(found: GainMap | None, alone: float, error: float) -> str:
    """Return what a map above the law brings: errors at legs left out, dB, without it and with."""
    if found is None:
        return f"none: no map tells legs that are left out better than the law, {alone:.1f} dB"
    told = f"{error:.1f} dB at legs left out one by one, {alone:.1f} by the law alone"
    return f"{told}; {_extent(found)} of the station's antenna"


def _extent(found: GainMap) -> str:
    up = ", ".join(f"{height:g}" for height in found.heights)
    step = found.east[1] - found.east[0]
    return f"{len(found.east)} x {len(found.north)} points by {step:.3g} m, {up} m above that"


def terrain_lines(found: GainMap, frequency: float) -> Iterator[Line]:
    """Yield free space at a `frequency`, MHz, and the map of what terrain takes."""
    yield "gain", f"{free_space_db(1e6 * frequency):.1f} - 20 log10 d dB, in free space"
    assert found.ground is not None
    low, high = round(float(found.ground.min())), round(float(found.ground.max()))
    yield "ground", f"{low} to {high} m above the station's, at {found.origin[2]:.0f} m"
    yield "map", f"{_extent(found)} ground"
    for each in _losses(found):
        told = f"{each['over_6_db']:.0%} of it loses over 6 dB, at most {each['most_db']:.1f}"
        yield f"at {each['height']:g} m", f"{told}; {each['below_ground']:.0%} is below ground"


def terrain_record(found: GainMap, frequency: float) -> dict[str, Any]:
    """Return the JSON object of `--json`."""
    level = {"reference_gain_db": free_space_db(1e6 * frequency), "exponent": 2.0}
    return level | {"origin": found.origin, "losses": list(_losses(found))}


def _losses(found: GainMap) -> Iterator[dict[str, float]]:
    """Yield for each height what is lost there, dB, and over which shares of the map."""
    for height, db in zip(found.heights.tolist(), found.db, strict=True):
        yield {
            "height": height,
            "over_6_db": float(np.mean(db < -6)),
            "most_db": float(np.max(-db, where=~np.isnan(db), initial=0.0)),
            "below_ground": float(np.mean(np.isnan(db))),
        }


def terrain_yaml(frequency: float, names: str) -> str:
    """Return the file that a plan's `gain` names, but for its map."""
    about = f"free space at {frequency:g} MHz, diffraction by ITU-R P.526 over {names}"
    level = free_space_db(1e6 * frequency)
    return f"about: {json.dumps(about)}\nreference_gain_db: {level:.2f}\nexponent: 2\n"


def _rests_on(fit: LinkFit) -> str:
    logs = ", ".join(dict.fromkeys(flight.source for flight in fit.flights))
    return f"{counted(fit.count, 'mean')} of {logs}"


def link_page(fit: LinkFit, absolute: bool) -> str:
    """Return the page about a fit: measured against fitted, and residuals on a map."""
    from faao_mav.report.page import facts, figure_section, page, section

    every = -(-fit.count // _MOST_SHOWN)
    place = fit.place[::every]
    level = np.concatenate([flight.level for flight in fit.flights])[::every]
    sections = [
        section("Link", facts(list(link_lines(fit, absolute))), "wide"),
        figure_section(
            "distance",
            "Over distance",
            _scatter(fit, place, level, "distance from the station, m"),
            "Measured and fitted gain over the distance from the station's antenna",
        ),
        figure_section(
            "elevation",
            "Over elevation",
            _scatter(fit, place, level, "elevation, degrees"),
            "Measured and fitted gain over the elevation at which the station sees the UAV",
        ),
        figure_section(
            "residuals",
            "Left by the law",
            _map(place, level - fit.gain_db(place)),
            "Measured over fitted gain, dB, where it was flown, metres east and north of the "
            "station",
        ),
    ]
    return page("The link as it was measured", "\n".join(sections))


def _scatter(fit: LinkFit, place: Real, level: Real, over: str) -> "Figure":
    distance = "distance" in over
    x = seen(place)[0 if distance else 1]
    with drawing(WIDTH, 3.2) as figure:
        plot = figure.subplots()
        plot.plot(x, level, ".", color=SERIES[0], markersize=2.5, alpha=0.4, label="measured")
        plot.plot(x, fit.gain_db(place), ".", color=SERIES[1], markersize=2.5, label="fitted")
        if distance:
            plot.set_xscale("log")
            ticks = [m * 10.0**k for k in range(6) for m in (1, 2, 5)]
            shown = [tick for tick in ticks if x.min() < tick < x.max()]
            plot.set_xticks(shown, [f"{tick:g}" for tick in shown])
            plot.set_xticks([], minor=True)
        label(plot, "", over, "gain, dB")
        legend_above(plot)
    return figure


def _map(place: Real, residual: Real) -> "Figure":
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    with drawing(WIDTH, 3.8) as figure:
        plot = figure.subplots()
        colours = ListedColormap(colormaps["coolwarm"](np.linspace(0.0, 1.0, _LEVELS)))
        shown = plot.scatter(place[:, 0], place[:, 1], c=residual, s=6, cmap=colours)
        shown.set_clim(-_SHOWN, _SHOWN)
        plot.plot([0], [0], "s", color=INK, markersize=7)
        plot.annotate("station", (0, 0), xytext=(7, 7), textcoords="offset points", color=INK)
        plot.set_aspect("equal", adjustable="datalim")
        bar = figure.colorbar(shown, ax=plot, shrink=0.8)
        bar.set_label("measured over fitted, dB")
        if bar.solids is not None:
            bar.solids.set_edgecolor("face")  # else hairlines of paper between the shades
        label(plot, "", "east, m", "north, m")
    return figure
