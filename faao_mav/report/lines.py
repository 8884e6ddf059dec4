"""Lines of text with labels, and the phrases that several of them share."""

from collections.abc import Iterable
from typing import TypeAlias

Line: TypeAlias = tuple[str, str]
"""A label and a text; a line without a label goes on where the one before it ended."""

_LABEL_WIDTH = 13
"""Characters that a label takes on the terminal."""


def joined(lines: Iterable[Line]) -> str:
    """Return `lines` as the terminal shows them."""
    return "\n".join(f"{label:<{_LABEL_WIDTH}}{text}" for label, text in lines)


def told_rate(rate: float, bandwidth_mhz: float | None) -> str:
    """Return `rate`, bit/s/Hz, as text, with a bandwidth in Mbit/s too."""
    megabits = "" if bandwidth_mhz is None else f" ({rate * bandwidth_mhz:.4g} Mbit/s)"
    return f"{rate:.4f} bit/s/Hz{megabits}"


def of_plan(rate: float, planned: float, bandwidth_mhz: float | None) -> str:
    """Return `rate` as text, and its share of the `planned` one."""
    share = 100 * rate / planned if planned else 100.0
    return f"{told_rate(rate, bandwidth_mhz)}, {share:.2f} % of the plan"


def carried(megabytes: float | None) -> str:
    """Return what is delivered as the end of a sentence, nothing where no bandwidth is given."""
    return "" if megabytes is None else f", {megabytes:.4g} megabytes"


def apart(rms: float, most: float, path: float) -> str:
    """Say how far, m, the predicted flight is from the plan."""
    at_equal_times = f"{rms:.1f} m rms from the plan at equal times, {most:.1f} m at most"
    return f"{at_equal_times}; {path:.1f} m from its path"
