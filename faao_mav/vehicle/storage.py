"""What autopilots keep of the rows that they accept: items, fence and rally points.

Items are `vehicle.dialects`'s business. Of fence and rally points ArduPilot keeps what its own
storage has room for: a vertex or circle no altitude, a rally point whole metres. Measured with
ArduCopter 4.7.0-dev.
"""

import math
from dataclasses import replace

from faao_mav.mission.command import CIRCLE, FENCE_RETURN_POINT, POLYGON, RALLY_POINT
from faao_mav.mission.item import MissionItem
from faao_mav.mission.vehicle import Vehicle
from faao_mav.vehicle import dialects as dialect

_FENCE = frozenset({*POLYGON.values(), *CIRCLE.values(), FENCE_RETURN_POINT})


def as_stored(item: MissionItem, vehicle: Vehicle) -> MissionItem:
    """Return `item`, of any of the three lists, as `vehicle` gives it back on download."""
    if item.command not in _FENCE and item.command != RALLY_POINT:
        return dialect.as_stored(item, vehicle)
    if vehicle.autopilot == "px4":
        return replace(item, frame={0: 5, 3: 6}.get(item.frame, item.frame))
    if item.command == RALLY_POINT:
        return replace(item, z=float(math.trunc(item.z)))
    altitude = item.z if item.command == FENCE_RETURN_POINT else 0.0
    return replace(item, frame={5: 0, 6: 3, 11: 10}.get(item.frame, item.frame), z=altitude)
