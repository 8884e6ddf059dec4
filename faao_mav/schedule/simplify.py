"""Few waypoints for a stretch of flight: the longest legs that stay on its path, evened out."""

from faao_mav.arrays import Real
from faao_mav.vector import distances_to_segment

_BISECTIONS = 8


def simplify(w: Real, tolerance: float) -> list[int]:
    """Return the indices between the first and the last sample that become waypoints.

    Each leg goes as far as the samples it passes over stay within `tolerance` (m) of it. With the
    number of legs that this takes, the least tolerance is sought that takes no more: legs in a
    bend are then of one length, where taking each as long as possible would leave a short last
    one, on which an autopilot crawls.

    `w` (n, 2) m, n >= 2, are the stretch with both its ends; every sample is within `tolerance`
    of the polyline through the ends and the result.
    """
    best = _longest(w, tolerance)
    low, high = 0.0, tolerance
    for _ in range(_BISECTIONS if best else 0):
        middle = (low + high) / 2
        tried = _longest(w, middle)
        if len(tried) <= len(best):
            best, high = tried, middle
        else:
            low = middle
    return best


def _longest(w: Real, tolerance: float) -> list[int]:
    """Return where legs end that each go as far as they can."""
    kept: list[int] = []
    first, last = 0, len(w) - 1
    while True:
        step = 1
        while first + step < last and _fits(w, first, min(first + 2 * step, last), tolerance):
            step = min(2 * step, last - first)
        if first + step >= last:
            return kept
        low, high = step, min(2 * step, last - first)
        while high - low > 1:
            middle = (low + high) // 2
            if _fits(w, first, first + middle, tolerance):
                low = middle
            else:
                high = middle
        first += low
        kept.append(first)


def _fits(w: Real, first: int, last: int, tolerance: float) -> bool:
    """Tell whether the samples between two stay close to the leg from one to the other."""
    passed = w[first + 1 : last]
    return bool(
        len(passed) == 0 or distances_to_segment(passed, w[first], w[last]).max() <= tolerance
    )
