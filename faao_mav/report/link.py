"""A link that was measured in flight: the fitted law, in lines, as a file and as a page."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from faao_mav.errors import counted
from faao_mav.radio.fit import SPREAD_OF_NO_LAW, LinkFit, seen
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.kriging import kriged
from faao_mav.radio.terrain import free_space_db
from faao_mav.report import style
from faao_mav.report.summary import Line

_SHOWN = 20.0  # dB left at which the map's colours end: thrice what shadowing leaves. Chosen
_LEVELS = 16  # colours on that map's scale. Chosen: their steps can hardly be seen
_MOST_SHOWN = 2000  # means that the page shows at most: a page of a megabyte. Chosen

_LAW = {
    "reference_gain_db": 2, "exponent": 3, "elevation_db": 2, "spread_db": 2, "correlation_m": 0,
    "elevation_deg": 1, "distance_m": 2,
}  # what a plan's `gain` takes of a fit, and its decimals  # fmt: skip


@dataclass(frozen=True, slots=True)
class LinkReport:
    """What is known of a link: `lines` for people, and the `record` of `--json`.

    `law` is what a plan has as its `gain`, by key, nothing where no law holds; `above` is the map
    that the law is to name, where there is one.
    """

    lines: list[Line]
    record: dict[str, Any]
    law: dict[str, Any]
    above: GainMap | None = None


def fitted(fit: LinkFit, absolute: bool, station: tuple[float, ...] | None = None) -> LinkReport:
    """Return the report on a `fit`, and for the place of a `station` what it leaves, as a map.

    A fit that is not `absolute` has a level within a constant. In the record errors are NaN where
    one leg tells none.
    """
    rests_on = f"{counted(fit.means, 'mean')} of {fit.flown.source}"
    record = {each.name: getattr(fit, each.name) for each in fields(fit)}
    del record["flown"], record["leg"]
    record["holds"] = fit.holds
    (near, far), (least, most) = fit.distance_m, fit.elevation_deg
    ranges = f"{near:.0f} to {far:.0f} m away, {least:.0f} to {most:.0f} degrees high"
    lines = [("gain", str(fit)), ("measured", f"{ranges}; {rests_on}")]
    if not absolute:
        record["reference_gain_db"] = None
        told = "shape only: the plan's radio.reference_gain_db stands; give --power for the level"
        lines[:1] = [("gain", f"{fit}, within a constant"), ("", told)]
    if fit.legs == 1:
        told = "one leg alone: d^-2 with its level, nothing that could be told from it"
        lines.append(("", told))
    else:
        heights = f" and {fit.heights} heights" if fit.heights > 1 else ""
        told = f"{fit.spread_db:.1f} dB at {counted(fit.legs, 'leg')}{heights} left out one by one "
        told += f"(d^-2: {fit.paper_spread_db:.1f}), correlated over {fit.correlation_m:.0f} m"
        error = f"{fit.gain_error_db:.1f} dB of the gain where it was flown, one standard error"
        lines += [("spread", told), ("error", error)]
    if not fit.holds:
        told = f"of distance and elevation holds: {fit.spread_db:.1f} dB are left, more than "
        told += f"{SPREAD_OF_NO_LAW:g}. Nothing is promised; raise the station's antenna over what "
        lines.append(("no law", f"{told}stands about it, or fly higher"))
        return LinkReport(lines, record, {})
    above, spread = None, fit.spread_db
    if station is not None:
        above, alone, left = kriged(fit, station)
        record |= {"left_out_db": alone, "left_out_map_db": left}
        told = f"none: no map tells legs that are left out better than the law, {alone:.1f} dB"
        if above is not None:
            spread = left
            told = f"{left:.1f} dB at legs left out one by one, {alone:.1f} by the law alone; "
            told += f"{_extent(above)} of the station's antenna"
        lines.append(("map", told))
    law = {"about": f"{fit}: {rests_on}"} | {
        key: np.round(record[key], decimals).tolist()
        for key, decimals in _LAW.items()
        if record[key] is not None
    }
    law["spread_db"] = max(0.01, round(spread, 2))  # a plan takes what is above 0
    return LinkReport(lines, record, law, above)


def over_terrain(found: GainMap, megahertz: float, names: str) -> LinkReport:
    """Return the report on free space at a frequency, and the map of what the terrain takes.

    `names` are the files of its heights. The record has for each height what is lost there, dB,
    and over which shares of the map.
    """
    level, ground = free_space_db(1e6 * megahertz), found.ground
    assert ground is not None
    losses = [
        {
            "height": height,
            "over_6_db": float(np.mean(db < -6)),
            "most_db": float(np.max(-db, where=~np.isnan(db), initial=0.0)),
            "below_ground": float(np.mean(np.isnan(db))),
        }
        for height, db in zip(found.heights.tolist(), found.db, strict=True)
    ]
    span = f"{round(float(ground.min()))} to {round(float(ground.max()))} m"
    lines = [
        ("gain", f"{level:.1f} - 20 log10 d dB, in free space"),
        ("ground", f"{span} above the station's, at {found.origin[2]:.0f} m"),
        ("map", f"{_extent(found)} ground"),
    ]
    for each in losses:
        told = f"{each['over_6_db']:.0%} of it loses over 6 dB, at most {each['most_db']:.1f}"
        told += f"; {each['below_ground']:.0%} is below ground"
        lines.append((f"at {each['height']:g} m", told))
    about = f"free space at {megahertz:g} MHz, diffraction by ITU-R P.526 over {names}"
    law = {"about": about, "reference_gain_db": round(level, 2), "exponent": 2}
    record = {"reference_gain_db": level, "exponent": 2.0, "origin": found.origin}
    return LinkReport(lines, record | {"losses": losses}, law, found)


def _extent(found: GainMap) -> str:
    up = ", ".join(f"{height:g}" for height in found.heights)
    step = found.east[1] - found.east[0]
    return f"{len(found.east)} x {len(found.north)} points by {step:.3g} m, {up} m above that"


def link_page(fit: LinkFit, report: LinkReport) -> str:
    """Return the page about a fit: its report, measured against fitted, and residuals on a map."""
    from matplotlib import colormaps

    from faao_mav.report.page import facts, figure_section, page, section

    every = -(-fit.means // _MOST_SHOWN)
    place, measured = fit.flown.place[::every], fit.flown.level[::every]
    law = fit.gain_db(place)
    dots: Any = {"linestyle": "none", "marker": ".", "markersize": 2.5}
    with style.drawing(style.WIDTH, 6.0) as gains:
        upper, lower = gains.subplots(2, sharey=True)
        for plot, x in zip((upper, lower), seen(place), strict=True):
            plot.plot(x, measured, color=style.SERIES[0], alpha=0.4, label="measured", **dots)
            plot.plot(x, law, color=style.SERIES[1], label="fitted", **dots)
        style.label(upper, "", "distance from the station, m", "gain, dB")
        style.label(lower, "", "elevation, degrees", "gain, dB")
        style.legend_above(upper)
    with style.drawing(style.WIDTH, 3.8) as left:
        plot = left.subplots()
        colours = colormaps["coolwarm"].resampled(_LEVELS)
        shown = plot.scatter(place[:, 0], place[:, 1], 6, measured - law, cmap=colours)
        shown.set_clim(-_SHOWN, _SHOWN)
        plot.set_aspect("equal", adjustable="datalim")
        style.colour_bar(plot, shown, "measured over fitted, dB", 0.8)
        style.label(plot, "", "east, m", "north, m")
        style.mark_stations(plot, [("station", np.zeros((1, 2)), "s")])
    title = "Measured and fitted gain over distance and elevation, seen from the station's antenna"
    told = "Measured over fitted gain, dB, where it was flown, metres east and north of the station"
    sections = (
        section("Link", facts(report.lines), "wide"),
        figure_section("Measured and fitted", gains, title),
        figure_section("Left by the law", left, told),
    )
    return page("The link as it was measured", "\n".join(sections))
