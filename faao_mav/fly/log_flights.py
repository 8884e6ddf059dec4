"""The flights of the vehicles in a log, made of its messages."""

import math
from array import array
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.errors import InputError
from faao_mav.fly.log_messages import Said
from faao_mav.fly.record import FlightRecord

_LEAST = 10
"""Positions that a flight has at least; chosen."""

_LONGEST = 86_400.0
"""Seconds that the clock of one vehicle goes on in a log, in which a departure is searched; chosen:
a day."""

_REBOOT, _BETWEEN = 2.0, 1000.0
"""Seconds by which a vehicle's clock goes back when it has booted again, less is a late packet; and
the seconds that are put there, and for any longer pause. Chosen: no flight goes on across them."""

_COLUMNS = 5
"""Numbers of a position as it is heard: s, degrees, degrees, m above the sea, m above home."""

_BOUNDS = (1e10, 90.0, 180.0, 1e5, 1e5)
"""What no position is beyond: s, degrees, degrees, and twice m; chosen."""

_JUMPS = (60.0, 0.1, 0.1, 1000.0, 1000.0)
"""By how much a damaged position stands out from the four around it, in the same units; chosen."""

_FASTEST_WIND = 100.0
"""m/s, in which nothing flies; chosen."""

_WINDS = (
    *("XKF2", "NKF2", "EKF2"),
    *("WIND", "WIND_COV"),
    *("wind", "wind_estimate", "estimator_wind"),
)
"""Messages about wind: of ArduPilot's estimators the newest first, of MAVLink, of PX4."""

_AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""


def flights(path: Path, said: Iterable[Said], system: int | None = None) -> list[FlightRecord]:
    """Return the flights of the vehicles that tell their positions in the log `path`.

    `system` chooses one. Of a system its autopilot counts, known by its number, or else the
    component that tells most positions: a companion may have a clock, a position and a wind of its
    own. Raises `InputError` where there is no flight.
    """
    heard = defaultdict[tuple[int, int], _Heard](_Heard)
    for number, component, name, fields in said:
        heard[number, component].hear(name, fields)
    records = [(component, each.record(number)) for (number, component), each in heard.items()]
    records.sort(key=lambda pair: (pair[0] == _AUTOPILOT, len(pair[1].t)))
    flown = {each.system: each for _, each in records if len(each.t) >= _LEAST}
    if not flown:
        most = max((len(each.t) for _, each in records), default=0)
        raise InputError(f"{path}: {most} positions; expected the log of a flight")
    if system is not None and system not in flown:
        numbers = ", ".join(map(str, sorted(filter(None, flown))))
        raise InputError(f"--system {system}: not in {path}, where positions are of: {numbers}")
    chosen = [each for number, each in flown.items() if system in (None, number)]
    longest = max(each.t[-1] - each.t[0] for each in chosen)
    if longest > _LONGEST:
        raise InputError(f"{path}: {longest / 3600:.0f} hours; expected the log of a flight")
    return chosen


class _Heard:
    """What one sender has said of its flight."""

    def __init__(self) -> None:
        self._fixes = array("d")
        self._winds = defaultdict[str, list[tuple[int, float, float]]](list)
        self._parameters: dict[str, float] = {}
        self._home = math.nan

    def hear(self, name: str, said: Mapping[str, float | str]) -> None:
        """Take note of a message."""

        def value(field: str) -> float:
            found = said.get(field, math.nan)
            return found if not isinstance(found, str) and math.isfinite(found) else math.nan

        match name:
            case "POS":
                heights = map(value, ("RelHomeAlt", "RelAlt", "RelOriginAlt"))
                height = next(filter(math.isfinite, heights), math.nan)
                place = value("Lat"), value("Lng"), value("Alt"), height
                self._fixes.extend((value("TimeUS") / 1e6, *place))
            case "GLOBAL_POSITION_INT":
                t, above, height = (value(x) / 1e3 for x in ("time_boot_ms", "alt", "relative_alt"))
                self._fixes.extend((t, value("lat") / 1e7, value("lon") / 1e7, above, height))
            case "vehicle_global_position":
                place = value("lat"), value("lon"), value("alt"), value("alt") - self._home
                self._fixes.extend((value("timestamp") / 1e6, *place))
            case "home_position" if said.get("valid_alt", True):
                self._home = value("alt")
            case "PARM":
                self._parameters[str(said.get("Name"))] = value("Value")
            case "PARAM_VALUE":
                self._parameters[str(said.get("param_id"))] = value("param_value")
            case "XKF2" | "NKF2" | "EKF2" if said.get("C", 0) == 0:  # the first of the estimators
                self._blow(name, value("VWE"), value("VWN"))
            case "WIND":  # where it comes from, degrees
                angle, speed = math.radians(value("direction")), value("speed")
                self._blow(name, -speed * math.sin(angle), -speed * math.cos(angle))
            case "WIND_COV":  # where it blows to
                self._blow(name, value("wind_y"), value("wind_x"))
            case "wind" | "wind_estimate" | "estimator_wind":
                self._blow(name, value("windspeed_east"), value("windspeed_north"))

    def _blow(self, name: str, east: float, north: float) -> None:
        """Take note of a wind at the time of the last position."""
        self._winds[name].append((len(self._fixes) // _COLUMNS - 1, east, north))

    def record(self, system: int) -> FlightRecord:
        """Return the flight, of several boots one after the other; `system` is 0 without one."""
        fixes = np.array(self._fixes).reshape(-1, _COLUMNS)
        t, latitude, longitude, altitude, height = fixes.T
        home = _as_last_known(altitude - height, altitude)
        height = np.where(np.isnan(height), altitude - home, height)
        table = np.stack([t, latitude, longitude, height, home], axis=1)
        rows = _sound_rows(table)
        t, later = _continuous(t[rows])
        rows = rows[later]
        _, latitude, longitude, height, home = table[rows].T
        return FlightRecord(
            t,
            latitude,
            longitude,
            height,
            wind=self._wind(t, rows),
            parameters={name: x for name, x in self._parameters.items() if math.isfinite(x)},
            home=home,
            system=system or None,
        )

    def _wind(self, t: Real, rows: Integers) -> Real | None:
        """Return times and winds (m, 3) of one estimator, where positions `rows` are those at `t`.

        It is the first that does not say zeros, as one does that does not run.
        """
        for name in _WINDS:
            row, *wind = np.array(self._winds[name]).reshape(-1, 3).T
            last = np.searchsorted(rows, row, "right") - 1
            known = (last >= 0) & (np.abs(wind) <= _FASTEST_WIND).all(axis=0)
            if np.any(wind, axis=0)[known].any():
                return np.stack([t[last[known]], *(each[known] for each in wind)], axis=1)
        return None


def _as_last_known(home: Real, altitude: Real) -> Real:
    """Return the altitudes of home (k,), m: each as last known, before that as first known.

    Where it is never known, home is where the first `altitude` is.
    """
    known = np.flatnonzero(np.abs(home) <= _BOUNDS[-1])
    if not len(known):
        return np.full(len(home), next(filter(math.isfinite, altitude), 0.0))
    last = np.searchsorted(known, np.arange(len(home)), "right") - 1
    return home[known[np.maximum(last, 0)]]


def _sound_rows(table: Real) -> Integers:
    """Return the numbers of the rows that are positions, of which none stands out."""
    from scipy.ndimage import median_filter

    told = table[:, 1:3].any(axis=1)  # at 0 degrees both: not known yet
    rows = np.flatnonzero(told & (np.abs(table) <= _BOUNDS).all(axis=1))
    if not len(rows):
        return rows
    around = median_filter(table[rows], size=(5, 1), mode="mirror")
    return rows[(np.abs(table[rows] - around) <= _JUMPS).all(axis=1)]


def _continuous(t: Real) -> tuple[Real, Integers]:
    """Return times that increase, over boots and pauses, and the numbers of those of `t` they are.

    What comes late is left out.
    """
    steps = np.diff(t, prepend=t[:1])
    apart = (steps < -_REBOOT) | (steps > _BETWEEN)
    t = t + np.cumsum(np.where(apart, _BETWEEN - steps, 0.0))
    newest = np.maximum.accumulate(np.concatenate([[-np.inf], t[:-1]]))
    later = np.flatnonzero(t > newest[: len(t)])
    return t[later], later
