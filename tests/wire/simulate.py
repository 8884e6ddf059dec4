"""Machines that talk over a bad link, on a clock that jumps from event to event."""

import heapq
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count, permutations
from typing import Any

from faao_mav.sim.faults import Channel, Faults
from faao_mav.wire.codec import Codec, message_id
from faao_mav.wire.messages import Envelope, Message
from faao_mav.wire.protocol import Address

_STEP = 1e-3  # s, least time between two ticks of a machine that stays due


@dataclass(slots=True)
class Station:
    """A machine on a simulated link, the address that it speaks from, and when it ticked last."""

    machine: Any
    address: Address
    ticked: float = -1.0

    def due(self) -> float | None:
        deadline = None if self.machine.outcome is not None else self.machine.deadline
        return None if deadline is None else max(deadline, self.ticked + _STEP)


def simulate(
    client: Station,
    server: Station,
    faults: Faults | None = None,
    until: float = 600.0,
    *,
    others: Sequence[Station] = (),
    events: Sequence[tuple[float, Callable[[float], object]]] = (),
    heard: Callable[[Envelope, float], object] | None = None,
    lost: tuple[int, int] | None = None,
    tapes: Sequence[list[bytes]] | None = None,
    passed: Counter[tuple[int, int, int]] | None = None,
) -> float:
    """Run until `client` has an outcome, or `until`, and return the time that it took, s.

    Everybody hears everybody, as behind a router, through `faults` that are drawn for each pair
    and direction. Packets are real ones: what is corrupted is rejected by its checksum, or is
    not. `events` are called at their times, with them; `heard` is told what the client receives.
    Of the message with the first number in `lost` each channel loses one, counted from 1. What the
    client and the server receive is appended to their `tapes`. Packets are counted in `passed` by
    their sender, their receiver (0 is the client, 1 the server) and the number of the message.
    """
    faults = faults or Faults()
    nodes = (client, server, *others)
    codecs = [Codec(node.address) for node in nodes]
    pairs = permutations(range(len(nodes)), 2)
    channels = {pair: Channel(faults, "{} to {}".format(*pair)) for pair in pairs}
    order = count()
    queue: list[tuple[float, int, int, bytes]] = []
    passed = Counter() if passed is None else passed
    planned = sorted(events, key=lambda event: event[0])

    def send(sender: int, messages: Sequence[Message], now: float) -> None:
        for message in messages:
            packet = codecs[sender].pack(message)
            number = message_id(packet)
            for (start, receiver), channel in channels.items():
                if start != sender:
                    continue
                passed[sender, receiver, number] += 1
                if (number, passed[sender, receiver, number]) != lost:
                    for time, arriving in channel.carry(packet, now):
                        heapq.heappush(queue, (time, next(order), receiver, arriving))

    now = 0.0
    for index in range(len(nodes) - 1, -1, -1):  # the client last: the others are there already
        send(index, nodes[index].machine.start(now), now)
    while client.machine.outcome is None:
        due = [
            (time, index) for index, node in enumerate(nodes) if (time := node.due()) is not None
        ]
        moments = [queue[0][0]] if queue else []
        moments += [min(due)[0]] if due else []
        moments += [planned[0][0]] if planned else []
        if not moments or min(moments) > until:
            return until
        now = max(now, min(moments))
        if planned and planned[0][0] <= now:
            planned.pop(0)[1](now)
        elif queue and queue[0][0] <= now:
            _, _, receiver, packet = heapq.heappop(queue)
            if tapes is not None:
                tapes[receiver].append(packet)
            for envelope in (found.envelope for found in codecs[receiver].parse(packet)):
                if receiver == 0 and heard is not None and envelope is not None:
                    heard(envelope, now)
                if envelope is not None:
                    send(receiver, nodes[receiver].machine.on(envelope, now), now)
        else:
            index = min(due)[1]
            nodes[index].ticked = now
            send(index, nodes[index].machine.tick(now), now)
    return now
