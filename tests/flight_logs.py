"""Logs of a flight as ArduPilot, PX4 and ground stations write them.

`wind` (k, 2) is m/s towards east and north. Sources: ArduPilot, "Log messages"; MAVLink, "File
formats"; PX4, "ULog file format".
"""

import math
import struct
from collections.abc import Iterator, Mapping
from operator import itemgetter
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from faao_mav.arrays import Real
from faao_mav.validate.flown import FlightRecord

_NONE: Mapping[str, float] = {}


def heights(record: FlightRecord) -> Real:
    """Return how high it was above home as that was then, m."""
    return record.altitude - record.home


def kept(record: FlightRecord, which: Any) -> FlightRecord:
    """Return some of the positions of a flight."""
    columns = (record.t, record.latitude, record.longitude, record.altitude, record.home)
    return FlightRecord.of(np.column_stack([*columns, record.wind, record.rssi])[which])


def ulog(
    record: FlightRecord, *, wind: Real | None = None, parameters: Mapping[str, float] = _NONE
) -> bytes:
    """Return a `.ulg`, which has a home where it is set or set again."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    formats = {
        "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
        "home_position": "uint64_t timestamp;float alt;bool valid_alt;",
        "wind": "uint64_t timestamp;float windspeed_north;float windspeed_east;",
        "radio_status": "uint64_t timestamp;uint8_t rssi;",
    }
    out = [b"ULog\x01\x12\x35\x01" + bytes(8), message(b"B", bytes(40))]
    out += [message(b"F", f"{name}:{fields}".encode()) for name, fields in formats.items()]
    for name, value in parameters.items():
        key = f"float {name}".encode()
        out.append(message(b"P", bytes([len(key)]) + key + struct.pack("<f", value)))
    for number, name in enumerate(formats):
        out.append(message(b"A", struct.pack("<BH", 0, number) + name.encode()))
    last = math.nan

    def add(layout: str, *values: Any) -> None:
        out.append(message(b"D", struct.pack(layout, *values)))

    for k, (t, *place, set_home) in enumerate(_places(record)):
        time = round(t * 1e6)
        if set_home != last:
            last = set_home
            add("<HQf?", 1, time, set_home, True)
        if math.isfinite(record.rssi[k]):
            add("<HQB", 3, time - 1, int(record.rssi[k]))
        add("<HQddf", 0, time, *place)
        if wind is not None:
            add("<HQff", 2, time, *wind[k, ::-1])
    return b"".join(out)


def dataflash(
    record: FlightRecord, *, wind: Real | None = None, parameters: Mapping[str, float] = _NONE
) -> bytes:
    """Return a `.bin`."""
    formats = (
        ("POS", "QLLff", "Qiiff", "Lat,Lng,Alt,RelHomeAlt"),
        ("XKF2", "QBff", "QBff", "C,VWN,VWE"),
        ("PARM", "QNf", "Q16sf", "Name,Value"),
        ("RAD", "QB", "QB", "RSSI"),
    )
    out, layouts = [], {}
    for number, (name, letters, layout, columns) in enumerate(formats):
        layouts[name] = number, f"<3B{layout}"
        size = struct.calcsize(layouts[name][1])
        texts = (name.encode(), letters.encode(), f"TimeUS,{columns}".encode())
        out.append(struct.pack("<5B4s16s64s", 0xA3, 0x95, 0x80, number, size, *texts))

    def add(name: str, *values: Any) -> None:
        number, layout = layouts[name]
        out.append(struct.pack(layout, 0xA3, 0x95, number, *values))

    for name, value in parameters.items():
        add("PARM", 0, name.encode(), value)
    for k, (t, latitude, longitude, altitude, its_home) in enumerate(_places(record)):
        place = round(latitude * 1e7), round(longitude * 1e7), altitude
        if math.isfinite(record.rssi[k]):
            add("RAD", round(t * 1e6), int(record.rssi[k]))
        add("POS", round(t * 1e6), *place, altitude - its_home)
        if wind is not None:
            add("XKF2", round(t * 1e6), 0, *wind[k, ::-1])
            add("XKF2", round(t * 1e6), 1, 9.0, 9.0)  # the second of the estimators
    return b"".join(out)


def heard(
    record: FlightRecord,
    *,
    sender: tuple[int, int] = (1, 1),
    delay: float = 0.0,
    wind: Real | None = None,
    parameters: Mapping[str, float] = _NONE,
) -> list[tuple[float, bytes]]:
    """Return what `sender` says of a flight, and when it is heard, s: `delay` after its clock."""
    link, radio, out = dialect.MAVLink(None, *sender), dialect.MAVLink(None, 51, 68), []

    def add(t: float, said: Any) -> None:
        out.append((t + delay, said.pack(link)))

    for name, value in parameters.items():
        add(record.t[0], dialect.MAVLink_param_value_message(name.encode(), value, 9, 1, 0))
    for k, (t, latitude, longitude, altitude, its_home) in enumerate(_places(record)):
        place = round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)
        height, ms = round((altitude - its_home) * 1e3), round(t * 1e3)
        if math.isfinite(record.rssi[k]):
            told = dialect.MAVLink_radio_status_message(int(record.rssi[k]), 9, 99, 9, 9, 0, 0)
            out.append((t + delay, told.pack(radio)))
        add(t, dialect.MAVLink_global_position_int_message(ms, *place, height, 0, 0, 0, 0))
        if wind is not None:
            source = np.degrees(np.arctan2(*-wind[k]))
            add(t, dialect.MAVLink_wind_message(source, np.hypot(*wind[k]), 0.0))
    return out


def tlog(*said: list[tuple[float, bytes]]) -> bytes:
    """Return a `.tlog` of what was `heard` of several."""
    merged = sorted((each for one in said for each in one), key=itemgetter(0))
    return b"".join(struct.pack(">Q", round((1e9 + t) * 1e6)) + packet for t, packet in merged)


def _places(record: FlightRecord) -> Iterator[tuple[float, ...]]:
    """Yield times, places, altitudes and the altitude of home."""
    columns = (record.t, record.latitude, record.longitude, record.altitude, record.home)
    yield from zip(*(column.tolist() for column in columns), strict=True)
