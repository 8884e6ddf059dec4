"""How figures look: colours, sizes, and the same bytes for the same figure, in a file or a page.

Figures are matplotlib's, made without pyplot: there is no global state and no window.
"""

import html
import io
import itertools
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.files import FIGURES, check_ending, write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

INK, MUTED, GRID, PAPER = "#1c1e21", "#5f6670", "#d9dce0", "#fefefe"
"""Colours of text, of what is secondary, of grids and of the paper; a page replaces them."""

SERIES = ("#1769aa", "#c2500a", "#16825d", "#9a3d9c", "#8a6d00", "#c03352", "#54606e")
"""Colours of curves in fixed order: the colour-blind tell them apart, on light and dark paper."""
SPEEDS = ("#9bd93c", "#4ac16d", "#1fa287", "#26818e", "#355f8d")
"""Colours of a route from standing to its top speed, on every map: viridis without its ends, which
vanish on white and on black paper."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")  # of curves, in the order of `SERIES`
WIDTH = 4.2  # inches: a page makes a figure as wide as a phone, where 9 points must still be read

_CLEAR = 2.5  # points from a text to lines and other texts. Chosen
_SIDES: list[dict[str, Any]] = [
    {"position": (away * x, away * y), "ha": across, "va": up}
    for away, (x, across), (y, up) in itertools.product(
        (4.0, 16.0),  # points. Chosen: beside the map's widest line, of 5 points, texts stay clear
        ((1, "left"), (-1, "right"), (0, "center")),
        ((1, "bottom"), (-1, "top"), (0, "center")),
    )
    if x or y
]
"""Where a text may stand beside its place, from the first that is tried on: eight sides, near and
for one that is not left out farther too."""

_ROLES = {INK: "--ink", MUTED: "--muted", GRID: "--grid", PAPER: "--paper"} | {
    colour: f"--s{k}" for k, colour in enumerate(SERIES)
}
"""The custom property of the page for each colour of the figures."""


@contextmanager
def styled() -> Iterator[None]:
    """Draw and save within this: matplotlib's settings are its global state."""
    from matplotlib import style

    sheet = Path(__file__).with_name("figures.mplstyle")
    with style.context(sheet, after_reset=True), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # names in any script
        yield


@contextmanager
def drawing(width: float, height: float) -> Iterator["Figure"]:
    """Give an empty figure of `width` by `height` inches, to be drawn within this."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def label(axes: "Axes", title: str, x: str, y: str) -> None:
    """Name a plot and its axes: a plan's names are no formulas."""
    plain = [text.replace("$", r"\$") for text in (title, x, y)]
    axes.set(title=plain[0], xlabel=plain[1], ylabel=plain[2])


def legend_above(axes: "Axes", columns: int = 4) -> None:
    """Put the legend over a plot that has no title, where it hides no curve."""
    handles, names = axes.get_legend_handles_labels()
    once = dict(zip(names, handles, strict=True))
    axes.legend(
        once.values(), once.keys(), ncols=columns, loc="lower right", bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.0, borderpad=0.2, columnspacing=0.9, handlelength=1.3, handletextpad=0.5,
    )  # fmt: skip


def colour_bar(axes: "Axes", colours: "ScalarMappable", text: str, shrink: float) -> None:
    """Put the scale of `colours`, named `text`, beside a plot."""
    figure = axes.get_figure()
    assert figure is not None
    bar = figure.colorbar(colours, ax=axes, label=text, shrink=shrink)
    if bar.solids is not None:
        bar.solids.set_edgecolor("face")  # else hairlines of paper between the shades


def mark_stations(
    axes: "Axes", places: Sequence[tuple[str, Any, str]], more: Sequence[tuple[str, Any]] = ()
) -> None:
    """Mark (name, places (k, 2), marker) on a plot that is finished, with their names beside them.

    They are marked where they are first. Of one that moves the way is a line, and there is a hollow
    mark where it ends. Each `more` (text, [east, north]) is written too, where it covers
    nothing.
    """
    held: Any = {"scalex": False, "scaley": False, "color": INK, "zorder": 5}
    for _, way, marker in places:
        axes.plot(*way[0], marker, markersize=7, **held)
        if np.ptp(way, axis=0).any():
            axes.plot(*np.transpose(way), linewidth=1.0, **held)
            axes.plot(*way[-1], marker, markersize=7, markerfacecolor=PAPER, **held)
    write_beside(axes, [*((name, way[0]) for name, way, _ in places), *more], always=len(places))


def write_beside(axes: "Axes", texts: Sequence[tuple[str, Any]], always: int = 0) -> None:
    """Write each (text, [east, north]) beside its place, where it covers no line and no text.

    Where there is no such place a text is left out; of the first `always` none is: they stand where
    they cover least.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.path import Path as MatplotlibPath

    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # from here on places on the paper are known
    routes = [each for each in axes.collections if isinstance(each, LineCollection)]
    ways = [np.concatenate(route.get_segments()) for route in routes]
    ways += [np.asarray(line.get_xydata()) for line in axes.lines]
    lines = [MatplotlibPath(axes.transData.transform(way)) for way in ways if len(way)]
    paper = axes.get_window_extent()
    taken: list[Any] = []
    for k, (text, place) in enumerate(texts):
        shown = axes.annotate(
            text, place, (0, 0), textcoords="offset points", fontsize=9 if k < always else 8,
            zorder=6, bbox={"facecolor": PAPER, "edgecolor": "none", "alpha": 0.75, "pad": 1.0},
        )  # fmt: skip
        tried = []
        for side in _SIDES if k < always else _SIDES[:8]:
            shown.set(**side)
            box = shown.get_window_extent()
            outside = not (paper.contains(*box.min) and paper.contains(*box.max))
            clear = box.padded(_CLEAR * figure.dpi / 72)
            covers = sum(line.intersects_bbox(clear, filled=False) for line in lines)
            covers += sum(clear.count_contains(line.vertices) for line in lines)
            tried.append(((outside, clear.count_overlaps(taken), covers), side, box))
        covered, side, box = min(tried, key=lambda each: each[0])
        if any(covered) and k >= always:
            shown.remove()
        else:
            shown.set(**side)
            taken.append(box)


def render(figure: "Figure", suffix: str) -> bytes:
    """Return `figure` as .png, .svg or .pdf; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with styled():
        figure.savefig(buffer, format=suffix.removeprefix("."), dpi=160, metadata=dates.get(suffix))
    return buffer.getvalue()


def save_figure(figure: "Figure", path: str | Path) -> None:
    """Write `figure` to `path`, whole or not at all, in the format of its ending.

    >>> from faao_mav import optimize, read_plan
    >>> save_figure(optimize(read_plan("missions/copter_relay.yaml")).plot(), "flight.gif")
    Traceback (most recent call last):
        ...
    faao_mav.errors.InputError: figure flight.gif: give a name that ends in .png, .svg, .pdf
    """
    path = Path(path)
    check_ending(path, "figure", FIGURES)
    write_whole(path, render(figure, path.suffix))


def inline_svg(figure: "Figure", name: str, title: str) -> str:
    """Return `figure` as an `<svg>` element of an HTML page, described by `title`.

    The colours of the style become the page's custom properties, so that they follow light and
    dark. `name` keeps the identifiers of one figure apart from those of the others.
    """
    text = render(figure, ".svg").decode()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    opening, rest = text.split(">", 1)
    box = re.search(r'viewBox="[^"]*"', opening)
    assert box is not None
    rest = re.sub(r'(\bid="|href="#|url\(#)', rf"\1{name}-", rest.replace("xlink:href", "href"))
    rest = re.sub(r"font: ([\d.]+px)[^;\"]*", r"font-size: \1", rest)
    rest = re.sub(r"font-family: [^;\"]*;? ?", "", rest)
    for colour, role in _ROLES.items():
        rest = rest.replace(colour, f"var({role})")
    label = f"{name}-title"
    return (
        f'<svg {box[0]} role="img" aria-labelledby="{label}">'
        f'<title id="{label}">{html.escape(title)}</title>{rest.strip()}'
    )
