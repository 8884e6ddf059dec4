"""What is read of packets without knowing their messages: where they begin and end, from whom.

Source: MAVLink developer guide, "Serialization".
"""

from faao_mav.wire.protocol import Address

_MAVLINK_1, _MAVLINK_2, _SIGNATURE = 0xFE, 0xFD, 13
"""First bytes of packets, and the bytes of a MAVLink 2 packet's signature."""

_AROUND = {_MAVLINK_1: 8, _MAVLINK_2: 12}
"""Bytes of a packet's header and checksum, by its first byte."""

_SIGNED = 0x01
"""The flag, in the third byte of a MAVLink 2 packet, that it has a signature. There are no others
yet, and a packet with one is not to be read."""


class Framer:
    """Cuts what one sender sends into packets, by the lengths that their headers tell.

    >>> framer = Framer()
    >>> framer.feed(bytes([0xFE, 1, 0, 1, 1, 0]))
    []
    >>> [packet.hex() for packet in framer.feed(bytes(3) + b"noise")]
    ['fe0100010100000000']
    """

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the packets that `data` completes; the beginning of one more is kept."""
        stream, packets, place = self._rest + data, [], 0
        while place < len(stream):
            if stream[place] not in _AROUND:
                place += 1
                continue
            end = place + _length_of(stream[place : place + 3])
            if end > len(stream):
                break
            if stream[place] == _MAVLINK_1 or stream[place + 2] <= _SIGNED:
                packets.append(stream[place:end])
            place = end
        self._rest = stream[place:]
        return packets

    def feed_datagram(self, data: bytes) -> list[bytes]:
        """Return the packets that the datagram `data` completes.

        Where it begins with a whole one, what is missing of the packet before it was cut off. Else
        it may go on with that one, as what comes from serial lines by a bridge does.
        """
        if 0 < _length_of(data[:3]) <= len(data):
            self._rest = b""
        return self.feed(data)


def is_signed(packet: bytes) -> bool:
    """Tell whether `packet` has a signature."""
    return packet[0] == _MAVLINK_2 and bool(packet[2] & _SIGNED)


def payload_of(packet: bytes) -> bytes | None:
    """Return what the MAVLink 2 `packet` carries; None for a MAVLink 1 packet."""
    return packet[10 : 10 + packet[1]] if packet[0] == _MAVLINK_2 else None


def sender_of(packet: bytes) -> Address:
    """Return who says that it sent `packet`."""
    system, component = packet[3:5] if packet[0] == _MAVLINK_1 else packet[5:7]
    return Address(system, component)


def message_id(packet: bytes) -> int:
    """Return the number of the message in `packet`."""
    if packet[0] == _MAVLINK_1:
        return packet[5]
    return int.from_bytes(packet[7:10], "little")


def _length_of(header: bytes) -> int:
    """Return how long the packet is that begins with the three bytes `header`, or with fewer.

    It is 0 where none begins.
    """
    if not header or header[0] not in _AROUND:
        return 0
    if len(header) < 3:
        return 3
    return header[1] + _AROUND[header[0]] + _SIGNATURE * is_signed(header)
