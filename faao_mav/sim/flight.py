"""A mock autopilot in flight: telemetry along a predicted track."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import Track
from faao_mav.mission.item import Home, MissionItem
from faao_mav.sim.turn_back import Breach
from faao_mav.wire.messages import (
    Attitude,
    GlobalPositionInt,
    LocalPositionNed,
    Message,
    MissionItemReached,
)

_FIRST_DO = 176  # below: navigation and conditions, which take time


@dataclass(frozen=True, slots=True)
class Posture:
    """Where the aircraft is and how it moves: east, north, up of home, m and m/s."""

    position: Real
    velocity: Real
    item: int


class MockFlight:
    """One flight along `track`, begun at `started`, flown `speedup` times as fast as predicted.

    `breach` is where it leaves the fence.
    """

    def __init__(
        self,
        track: Track,
        items: Sequence[MissionItem],
        started: float,
        speedup: float,
        breach: Breach | None = None,
    ) -> None:
        self._track, self._started, self._speedup = track, started, speedup
        self._breach = breach
        self._over = False
        self._pending = sorted(
            (float(time), _reached_number(items, index))
            for index, time in enumerate(track.reached)
            if math.isfinite(time) and index < len(items)
        )

    @property
    def end(self) -> float:
        """When the track ends, on the clock of `started`."""
        return self._started + float(self._track.t[-1]) / self._speedup

    @property
    def next_event(self) -> float:
        """When the next item is reached, the fence is left, or the track ends; inf after that."""
        if self._over:
            return math.inf
        times = [time for time, _ in self._pending[:1]]
        times += [self._breach.time] if self._breach is not None else []
        return min([self._started + time / self._speedup for time in times] + [self.end])

    def breached(self, now: float) -> Breach | None:
        """Return the breach of the fence since the last call, if there is one."""
        breach = self._breach
        # A little early rather than a tick late, as in `reached`.
        if breach is None or (now - self._started) * self._speedup < breach.time - 1e-6:
            return None
        self._breach = None
        return breach

    def ended(self, now: float) -> bool:
        """Tell whether the track has ended, which is no event any more then."""
        self._over = now >= self.end
        return self._over

    def delay(self, seconds: float) -> None:
        """Let the rest of the flight be `seconds` later, after a break."""
        self._started += seconds

    @property
    def lands(self) -> bool:
        """Whether it ends on the ground."""
        return self._track.lands

    def at(self, now: float) -> Posture:
        """Return the posture at `now`; after the end, the last one at rest."""
        track, time = self._track, (now - self._started) * self._speedup
        if time >= track.t[-1]:
            return Posture(track.position[-1], np.zeros(3), int(track.item[-1]))
        position, velocity = (
            np.array([np.interp(time, track.t, values[:, axis]) for axis in range(3)])
            for values in (track.position, track.velocity)
        )
        sample = int(np.searchsorted(track.t, time, side="right")) - 1
        return Posture(position, velocity, int(track.item[max(sample, 0)]))

    def reached(self, now: float, first: int) -> list[Message]:
        """Return what has been reached since the last call; `first` is the first item's number."""
        time = (now - self._started) * self._speedup
        # A little early rather than a tick late: the clock was asked for exactly this time.
        due = [number for when, number in self._pending if when <= time + 1e-6]
        self._pending = self._pending[len(due) :]
        return [MissionItemReached(number + first) for number in due]


def telemetry(posture: Posture, home: Home, since_boot: float) -> list[Message]:
    """Return the position reports of `posture`, `since_boot` seconds after start-up."""
    milliseconds = int(since_boot * 1000) % 2**32
    east, north, up = (float(value) for value in posture.position)
    v_east, v_north, v_up = (float(value) for value in posture.velocity)
    latitude, longitude = _geodetic(home, east, north)
    heading = math.atan2(v_east, v_north)
    return [
        GlobalPositionInt(
            milliseconds,
            round(latitude * 1e7),
            round(longitude * 1e7),
            _fitted((home.altitude + up) * 1000, 32),
            _fitted(up * 1000, 32),
            _fitted(100 * v_north, 16),
            _fitted(100 * v_east, 16),
            _fitted(-100 * v_up, 16),
            round(math.degrees(heading) % 360 * 100) % 36_000,
        ),
        LocalPositionNed(milliseconds, north, east, -up, v_north, v_east, -v_up),
        Attitude(milliseconds, 0.0, 0.0, heading, 0.0, 0.0, 0.0),
    ]


def _fitted(value: float, bits: int) -> int:
    """What a field of so many bits holds: 300 m/s and more are cut."""
    most = (1 << bits - 1) - 1
    return round(min(max(value, -most), most))


def _geodetic(home: Home, east: float, north: float) -> tuple[float, float]:
    if not (east or north):
        return home.latitude, home.longitude
    from faao_mav.geodesy import LocalFrame

    frame = LocalFrame(home.latitude, home.longitude)
    latitude, longitude = frame.to_geodetic([east, north])
    return float(latitude), float(longitude)


def _reached_number(items: Sequence[MissionItem], index: int) -> int:
    """Return the number that is told for item `index`: both autopilots name a DO that follows."""
    following = index + 1
    if following < len(items) and items[following].command >= _FIRST_DO:
        return following
    return index
