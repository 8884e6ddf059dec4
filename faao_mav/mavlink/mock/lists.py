"""A mock autopilot's three lists, and how rows are put into them."""

import struct
import zlib
from collections.abc import Iterable

from faao_mav.mavlink.messages import Row
from faao_mav.mavlink.rows import item_of, row_of
from faao_mav.mavlink.transfer.protocol import MissionType
from faao_mav.mission.item import Home
from faao_mav.vehicle import Vehicle
from faao_mav.vehicle.storage import as_stored


class Lists:
    """What is stored: rows as the vehicle gives them back."""

    def __init__(self, vehicle: Vehicle, home: Home) -> None:
        self.vehicle, self.home = vehicle, home
        self._rows: dict[MissionType, list[Row]] = {part: [] for part in MissionType}
        if vehicle.autopilot == "ardupilot":
            self._rows[MissionType.MISSION] = [self._home_row()]

    def rows(self, part: MissionType) -> tuple[Row, ...]:
        """Return what a download gives."""
        return tuple(self._rows[part])

    def put(self, part: MissionType, seq: int, row: Row) -> None:
        """Store `row` in place of the one at `seq`, or behind the last one."""
        rows = self._rows[part]
        rows[seq : seq + 1] = [self.kept(part, seq, row)]

    def kept(self, part: MissionType, seq: int, row: Row) -> Row:
        """Return what becomes of `row`; ArduPilot's row 0 is its home, whatever is sent."""
        if self.vehicle.autopilot == "ardupilot" and part is MissionType.MISSION and seq == 0:
            return self._home_row()
        return row_of(as_stored(item_of(row), self.vehicle), seq)

    def replace(self, part: MissionType, rows: Iterable[Row]) -> None:
        """Store all of `rows`, which are as `kept` gives them, in place of the list."""
        self._rows[part] = list(rows)

    def truncate(self, part: MissionType, count: int) -> None:
        """Forget what is beyond `count`."""
        del self._rows[part][count:]

    def clear(self, part: MissionType) -> None:
        """Forget all but home."""
        keep = int(self.vehicle.autopilot == "ardupilot" and part is MissionType.MISSION)
        self.truncate(part, keep)

    def number(self, part: MissionType) -> int:
        """Return a number that tells this list from others: a checksum; 0 when empty."""
        packed = b"".join(
            struct.pack("<HB5f2i", row.command, row.frame, *row.params, row.z, row.x, row.y)
            for row in self._rows[part]
        )
        return zlib.crc32(packed)

    def _home_row(self) -> Row:
        home = self.home
        place = (round(home.latitude * 1e7), round(home.longitude * 1e7), home.altitude)
        return Row(16, 0, (0.0, 0.0, 0.0, 0.0), *place)
