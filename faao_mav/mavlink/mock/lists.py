"""A mock autopilot's three lists, and how items are put into them."""

import struct
import zlib
from collections.abc import Iterable

from faao_mav.mavlink.messages import WireItem
from faao_mav.mavlink.protocol import MissionType
from faao_mav.mavlink.wire_items import home_items, mission_item, wire_item
from faao_mav.mission.item import Home
from faao_mav.vehicle import VehicleType


class StoredLists:
    """What is stored: items as the vehicle gives them back."""

    def __init__(self, vehicle: VehicleType, home: Home) -> None:
        self.vehicle, self.home = vehicle, home
        self._items = {
            part: [self._home_item()] * home_items(vehicle, part) for part in MissionType
        }

    def items(self, part: MissionType) -> tuple[WireItem, ...]:
        """Return what a download gives."""
        return tuple(self._items[part])

    def put(self, part: MissionType, seq: int, item: WireItem) -> None:
        """Store `item` in place of the one at `seq`, or behind the last one."""
        self._items[part][seq : seq + 1] = [self.kept(part, seq, item)]

    def kept(self, part: MissionType, seq: int, item: WireItem) -> WireItem:
        """Return what becomes of `item`; a home item is the vehicle's own, whatever is sent."""
        if seq < home_items(self.vehicle, part):
            return self._home_item()
        return wire_item(self.vehicle.dialect.stored(mission_item(item)), seq)

    def replace(self, part: MissionType, items: Iterable[WireItem]) -> None:
        """Store all of `items`, which are as `kept` gives them, in place of the list."""
        self._items[part] = list(items)

    def truncate(self, part: MissionType, count: int) -> None:
        """Forget what is beyond `count`."""
        del self._items[part][count:]

    def clear(self, part: MissionType) -> None:
        """Forget all but home."""
        self.truncate(part, home_items(self.vehicle, part))

    def number(self, part: MissionType) -> int:
        """Return a number that tells this list from others: a checksum; 0 when empty."""
        packed = b"".join(
            struct.pack("<HB5f2i", item.command, item.frame, *item.params, item.z, item.x, item.y)
            for item in self._items[part]
        )
        return zlib.crc32(packed)

    def _home_item(self) -> WireItem:
        home = self.home
        place = (round(home.latitude * 1e7), round(home.longitude * 1e7), home.altitude)
        return WireItem(16, 0, (0.0, 0.0, 0.0, 0.0), *place)
