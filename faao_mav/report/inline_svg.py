"""A figure as SVG that belongs to a page: its colours, its font, nothing from elsewhere."""

import html
import re
from typing import TYPE_CHECKING

from faao_mav.report.style import GRID, INK, MUTED, PAPER, SERIES, render

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROLES = {INK: "--ink", MUTED: "--muted", GRID: "--grid", PAPER: "--paper"} | {
    colour: f"--s{k}" for k, colour in enumerate(SERIES)
}


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
    rest = re.sub(r'\bid="([^"]*)"', rf'id="{name}-\1"', rest)
    rest = re.sub(r'(?:xlink:)?href="#([^"]*)"', rf'href="#{name}-\1"', rest)
    rest = re.sub(r"url\(#([^)]*)\)", rf"url(#{name}-\1)", rest)
    rest = re.sub(r"font: ([\d.]+px)[^;\"]*", r"font-size: \1", rest)
    rest = re.sub(r"font-family: [^;\"]*;? ?", "", rest)
    for colour, role in _ROLES.items():
        rest = rest.replace(colour, f"var({role})")
    label = f"{name}-title"
    return (
        f'<svg {box[0]} role="img" aria-labelledby="{label}">'
        f'<title id="{label}">{html.escape(title)}</title>{rest.strip()}'
    )
