"""The plan itself: all its sections, and what follows from them; where ground bars the flight.

Validated, in SI and linear units, frozen. The same declarations say what `plan.yaml` may hold: each
field is a key, with what it means, its unit and its limits. `fields` says how, `keys.reference`
lists them all.
"""

import math
from collections.abc import Sequence
from dataclasses import field
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot import Vehicle, VehicleType, vehicle_type
from faao_mav.autopilot.body import Body
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import Area, FreeArea, areas_of
from faao_mav.plan.fields import DEFAULTS, Text, section
from faao_mav.plan.radio import Radio
from faao_mav.plan.sections import (
    FenceOptions,
    Flight,
    Goal,
    MissionOptions,
    Optimizer,
    Origin,
    Site,
    Study,
)
from faao_mav.plan.vehicle import VehicleOptions
from faao_mav.power import PowerModel
from faao_mav.radio.gain_map import GainMap
from faao_mav.vector import Vector

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


@section
class PlanContents:
    """What a plan holds, and what follows from it; `reader.Plan` has its text besides.

    `geofence` has the zones of `fence` and of its file, in degrees.
    """

    name: Annotated[Text, Field(max_length=200)] = ""
    site: Site
    vehicle: VehicleOptions
    flight: Flight
    radio: Radio
    optimizer: Optimizer = field(default_factory=DEFAULTS)
    goal: Goal = field(default_factory=DEFAULTS)
    fence: FenceOptions | None = None
    mission: MissionOptions = field(default_factory=DEFAULTS)
    study: Study | None = None
    geofence: Fence = field(init=False)

    @property
    def origin(self) -> Origin:
        """The point of local [0, 0]."""
        return self.site.origin

    @property
    def power_model(self) -> PowerModel | None:
        """What flight takes; None where the plan does not say."""
        asked = self.vehicle.power
        return None if asked is None else asked.model(hovers=self._known.hovers)

    @property
    def body(self) -> Body | None:
        """The airframe; None where no flight model of the vehicle has one."""
        return self._bare.airframe

    @property
    def powers(self) -> tuple[float, float]:
        """W_B and W_U, W."""
        return self.radio.base_station.power, self.radio.relay.power

    @property
    def wind(self) -> Vector:
        """The velocity of the air over the ground, [east, north] m/s."""
        return self.site.wind.velocity

    @property
    def max_ground_speed(self) -> float:
        """The greatest speed over the ground, m/s: a plane's may be above `vehicle.max_speed`."""
        most = self.vehicle.max_speed
        return most if self._known.hovers else most + self.site.wind.speed

    @property
    def max_airspeed(self) -> float:
        """The greatest airspeed in the mean wind, m/s, with what gusts take off.

        Infinite where the limit on the speed over the ground is enough.
        """
        wind, most = self.site.wind, self.vehicle.max_airspeed
        gusts = max(0.0, wind.gust - wind.speed)
        if most is None:
            most = self._bare.held_airspeed if wind.speed or gusts else math.inf
        if not self._known.hovers:
            most = min(most, self.vehicle.max_speed)
        return most - gusts if most - gusts < self.max_ground_speed + wind.speed else math.inf

    @property
    def _known(self) -> VehicleType:
        return vehicle_type(self.vehicle.autopilot, self.vehicle.type)

    @property
    def _bare(self) -> Vehicle:
        """The vehicle with its autopilot's own parameters."""
        return Vehicle(self.vehicle.autopilot, self.vehicle.type, body=self.vehicle.body)

    @property
    def zones(self) -> tuple[Area, ...]:
        """The zones of `geofence` in local metres."""
        return _zones(self.geofence, self.origin.frame)

    @property
    def any_inclusion(self) -> bool:
        """Whether the vehicle's fence asks for one of several inclusions, not for all of them.

        That is so by its autopilot's own parameters: a plan that keeps inside all is right for
        others too.
        """
        return self._known.fence_needs_one_inclusion(self._bare)

    @property
    def maps(self) -> tuple[GainMap, ...]:
        """The maps of the gains, each once."""
        return tuple(dict.fromkeys(law.map for law in self.radio.gain_laws if law.map is not None))

    @property
    def ground(self) -> tuple[Area, ...]:
        """Where ground under the maps is higher than the flight, as areas to stay out of."""
        flight = self.flight
        return ground_areas(self.maps, flight.altitude, (flight.start, flight.end, (0.0, 0.0)))

    @property
    def keep_in(self) -> FreeArea | None:
        """Where fence, ground and maps let the aircraft be, local metres; None without any of them.

        The `margin` is not taken off.
        """
        if not self.geofence and not self.ground and self.map_edge is None:
            return None
        return _free_area((*self.zones, *self.ground), self.any_inclusion, self.map_edge)

    @property
    def margin(self) -> float:
        """How far the path keeps from the edge of where it may be, m.

        Without a fence it is as far as it may stray.
        """
        return self.mission.path_tolerance if self.fence is None else self.fence.margin

    @property
    def map_edge(self) -> tuple[Vector, Vector] | None:
        """The rectangle where the gains are known, [east, north] m of two corners, the lower first.

        None where they are known everywhere; it is empty where maps lie apart.
        """
        known = [law.whole for law in self.radio.gain_laws if law.whole]
        if not known:
            return None
        east, north = [each.east for each in known], [each.north for each in known]
        low = max(float(x[0]) for x in east), max(float(y[0]) for y in north)
        return low, (min(float(x[-1]) for x in east), min(float(y[-1]) for y in north))

    def megabits(self, rate: float) -> float | None:
        """Return `rate`, bit/s/Hz, in Mbit/s; None without `radio.bandwidth_mhz`."""
        bandwidth = self.radio.bandwidth_mhz
        return None if bandwidth is None else rate * bandwidth

    def megabytes(self, rate: float) -> float | None:
        """Return what `rate`, bit/s/Hz, carries in the duration T, 10^6 bytes, as `megabits`."""
        megabits = self.megabits(rate)
        return None if megabits is None else megabits * self.flight.duration / 8

    @property
    def needed_rate(self) -> float:
        """The delivered rate that `goal` asks for in the duration T, bit/s/Hz; 0 if for none."""
        asked, bandwidth = self.goal.deliver_mbytes, self.radio.bandwidth_mhz
        if asked is None or bandwidth is None:
            return self.goal.rate or 0.0
        return 8 * asked / (bandwidth * self.flight.duration)


_zones = lru_cache(maxsize=16)(areas_of)


@lru_cache(maxsize=16)
def _free_area(
    zones: tuple[Area, ...], any_inclusion: bool, mapped: tuple[Vector, Vector] | None
) -> FreeArea:
    free = FreeArea.of(zones, any_inclusion=any_inclusion)
    return free if mapped is None else free.within(*mapped)


_MOST_CORNERS = 200
"""Corners of all areas of ground above which they are made simpler. Chosen: the shortest way among
so many takes a third of a second, among 1,000 half a minute."""

_COARSER = 2
"""How often areas are made simpler, each time by twice as much as before. Chosen: once more bars a
third of a map of which a tenth is ground."""


@lru_cache(maxsize=16)
def ground_areas(
    maps: Sequence[GainMap], height: float, kept: Sequence[Vector]
) -> tuple[Area, ...]:
    """Return the ground of `maps` at a `height`, m, as areas to stay out of.

    Each barred point of a map bars the cell about it. Cells are joined over gaps of less than one
    cell, without the holes in which none of the places `kept` is, and simplified outwards by half a
    cell: by more where many corners are left and none of the `kept` would be barred by it.
    """
    import shapely

    barred = _barred(maps, height)
    if barred.is_empty:
        return ()
    by = max(max(_steps(each)) for each in maps) / 2
    found, places = _simplified(barred, by, kept), shapely.points(kept)
    for _ in range(_COARSER):
        if shapely.get_num_coordinates(found) <= _MOST_CORNERS:
            break
        by *= 2
        simpler = _simplified(barred, by, kept)
        if (shapely.covers(simpler, places) & ~shapely.covers(found, places)).any():
            break
        found = simpler
    return tuple(Area("the ground", False, part) for part in shapely.get_parts(found))


def in_ground(maps: Sequence[GainMap], height: float, places: Real) -> Flags:
    """Return which of `places` (n, 2), m, are in the ground of `maps` at a `height`, m."""
    import shapely

    return np.asarray(shapely.intersects_xy(_barred(maps, height), *places.T))


def _steps(known: GainMap) -> tuple[float, float]:
    return float(known.east[1] - known.east[0]), float(known.north[1] - known.north[0])


@lru_cache(maxsize=16)
def _barred(maps: Sequence[GainMap], height: float) -> "BaseGeometry":
    """Return the cells about the points of `maps` whose ground is above a `height`, m."""
    import shapely

    boxes = []
    for known in maps:
        dx, dy = _steps(known)
        edges = np.diff(np.pad(known.barred(height), ((0, 0), (1, 1))).astype(int), axis=1)
        (row, first), (_, last) = np.nonzero(edges > 0), np.nonzero(edges < 0)  # runs of each row
        x, y = known.east[0] - dx / 2, known.north[0] - dy / 2
        boxes += [*shapely.box(x + dx * first, y + dy * row, x + dx * last, y + dy * (row + 1))]
    found = shapely.union_all(boxes)
    shapely.prepare(found)
    return found


def _simplified(barred: "BaseGeometry", by: float, kept: Sequence[Vector]) -> "BaseGeometry":
    """Return what covers `barred`, by at most about 2 `by`, m, more."""
    import shapely

    closed = barred.buffer(by, join_style="mitre").buffer(-by, join_style="mitre")
    wide = closed.union(barred).buffer(by, join_style="mitre").simplify(by).union(barred)
    places, parts = shapely.points(kept), []
    for part in shapely.get_parts(wide):
        holes = [r for r in part.interiors if shapely.covers(shapely.Polygon(r), places).any()]
        parts.append(shapely.Polygon(part.exterior, holes))
    return shapely.union_all(parts)
