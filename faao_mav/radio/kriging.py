"""What a fitted law leaves of a log, as a map above it: simple kriging of the residuals.

Their mean is 0, so that the law alone stands away from the log. Their covariance is
(1 - nu) exp(-r / L), and nu at one place alone: what is measured there and not seen again. Share
and length are those with which legs that were left out are told best.
"""

from collections.abc import Sequence

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.radio.fit import APART, PAYS, LinkFit
from faao_mav.radio.gain_map import GainMap

_MOST_MEANS = 1000
"""Means that the map rests on at most, at even distances in the log, for time. Chosen."""

_NUGGETS, _LENGTHS = (0.3, 0.5, 0.7, 0.9), (0.5, 1.0, 2.0)
"""Shares nu, and lengths L over that of the fit, that are tried. Chosen."""

_REACH, _MOST_POINTS, _MOST_UP = 2.0, 120, 8
"""Lengths L beyond the log to which the map goes, where an eighth is left, and its steps each way
and up at most. Chosen."""


def kriged(fit: LinkFit, station: Sequence[float]) -> tuple[GainMap | None, float, float]:
    """Return the map above the law of `fit`, and the errors without and with it, dB rms.

    Those are at legs left out one by one. `station` is latitude and longitude, degrees, of the
    antenna: the map's own origin. The map is None where it tells those legs no better.
    """
    every = -(-fit.means // _MOST_MEANS)
    place, legs = fit.flown.place[::every], fit.leg[::every]
    residual = fit.flown.level[::every] - fit.gain_db(place)
    away = np.linalg.norm(place[:, None] - place, axis=-1)
    alone = float(np.sqrt(np.mean(residual**2)))
    found, error, length = None, (1.0 - PAYS) * alone, 0.0
    for L in np.maximum(1.0, fit.correlation_m * np.array(_LENGTHS)):
        for nugget in _NUGGETS:
            inverse = np.linalg.inv(
                (1 - nugget) * np.exp(-away / L) + nugget * np.eye(len(residual))
            )
            tried = _left_out(inverse, residual, legs)
            if tried < error:
                found, error, length = (1 - nugget) * (inverse @ residual), tried, float(L)
    if found is None:
        return None, alone, alone
    least, most = place.min(axis=0) - _REACH * length, place.max(axis=0) + _REACH * length
    count = np.clip((most - least)[:2] * 4 / length, 2, _MOST_POINTS).astype(int)
    east, north = (np.linspace(least[i], most[i], count[i]) for i in range(2))
    up = np.round(place[:, 2] / APART)
    step = np.ceil(np.ptp(up) / _MOST_UP) or 1.0
    heights = APART * np.arange(up.min(), up.max() + step, step)
    db = np.empty((len(heights), len(north), len(east)))
    for j, m in np.ndindex(db.shape[:2]):
        row = np.stack(np.broadcast_arrays(east, north[m], heights[j]), axis=-1)
        db[j, m] = np.exp(-np.linalg.norm(row[:, None] - place, axis=-1) / length) @ found
    return GainMap(east, north, heights, db, True, None, tuple(station[:2])), alone, error


def _left_out(inverse: Real, residual: Real, legs: Integers) -> float:
    """Return the rms of what the rest tells of each leg, against it, by the block's own inverse."""
    error, told = np.empty_like(residual), inverse @ residual
    for leg in np.unique(legs):
        out = np.flatnonzero(legs == leg)
        error[out] = np.linalg.solve(inverse[np.ix_(out, out)], told[out])
    return float(np.sqrt(np.mean(error**2)))
