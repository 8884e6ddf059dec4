"""PX4 logs (`.ulg`) of a given flight, after the description of the format."""

import struct
from typing import Any

from faao_mav.mavlink.flying.record import FlightRecord


def ulog(record: FlightRecord, *, wind: tuple[float, float] | None = None) -> bytes:
    """Return a `.ulg` file: https://docs.px4.io/main/en/dev_log/ulog_file_format."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    formats = {
        "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
        "home_position": "uint64_t timestamp;float alt;",
        "wind": "uint64_t timestamp;float windspeed_north;float windspeed_east;",
    }
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", int(record.t[0] * 1e6))
    out += message(b"B", bytes(40))
    for name, fields in formats.items():
        out += message(b"F", f"{name}:{fields}".encode())
    parameter = b"float MPC_XY_CRUISE"
    out += message(b"P", bytes([len(parameter)]) + parameter + struct.pack("<f", 6.0))
    for number, name in enumerate(formats):
        out += message(b"A", struct.pack("<BH", 0, number) + name.encode())
    start = int(record.t[0] * 1e6)
    out += message(b"D", struct.pack("<HQf", 1, start, 584.0))
    rows = zip(record.t, record.latitude, record.longitude, record.height, strict=True)
    for t, latitude, longitude, height in rows:
        time = round(t * 1e6)
        place = struct.pack("<HQddf", 0, time, latitude, longitude, 584.0 + height)
        out += message(b"D", place)
        if wind is not None:
            out += message(b"D", struct.pack("<HQff", 2, time, wind[1], wind[0]))
    return out


def kept(record: FlightRecord, which: Any) -> FlightRecord:
    columns = (record.t, record.latitude, record.longitude, record.height)
    return FlightRecord(*(column[which] for column in columns))
