"""Whole jobs on a vehicle, as talks: upload and verify, download everything, clear and verify."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from faao_mav.mission.item import Mission
from faao_mav.wire.machine import Talk
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MavResult, MissionType, listed, meaning
from faao_mav.wire.transfer.exchange import (
    TENTATIVE,
    Outcome,
    Peer,
    clear_list,
    read_list,
    send_list,
)
from faao_mav.wire.transfer.verify import Difference, compare
from faao_mav.wire.wire_items import autopilot_name, home_items

PartVerdict: TypeAlias = Literal[
    "verified", "different", "unread", "refused", "silent", "armed", "cancelled"
]

ABSENT = frozenset({MavResult.UNSUPPORTED, MavResult.INVALID})
"""What a vehicle answers that has no such list at all."""


@dataclass(frozen=True, slots=True)
class PartReport:
    """What became of one list.

    `verdict`: "verified": the list was read back, and is what was sent but for what `differences`
    tell as dropped; "different": it is not; "unread": accepted, but could not be read back;
    otherwise it is not known to be there. `items` leaves out the home item; `item`, the number of
    the item last asked for, does not. `attempts` counts uploads, `said` are the vehicle's own
    words.
    """

    part: MissionType
    items: int
    verdict: PartVerdict
    differences: tuple[Difference, ...] = ()
    result: int | None = None
    item: int | None = None
    attempts: int = 1
    said: tuple[str, ...] = ()
    opaque_id: int = 0

    @property
    def verified(self) -> bool:
        """Whether the list is on the vehicle, whole and equal."""
        return self.verdict == "verified"


@dataclass(frozen=True, slots=True)
class Lists:
    """What was downloaded; `missing` says why a list is not among `items`."""

    items: dict[MissionType, tuple[WireItem, ...]]
    missing: dict[MissionType, Outcome]


def upload_parts(
    parts: Sequence[tuple[MissionType, tuple[WireItem, ...]]], peer: Peer
) -> Talk[tuple[PartReport, ...]]:
    """Upload lists one after the other, read each back and compare; stop at the first failure.

    A transfer that the link broke is begun again, and one whose last answer was lost or whose
    list reads back differently too (ArduPilot now and then loses a fence that it accepted), at
    most `Timeouts.attempts` times. A refusal is final, except one that may be about something else.
    """
    reports: list[PartReport] = []
    for part, items in parts:
        reports.append((yield from _upload_part(part, items, peer)))
        if not reports[-1].verified:
            break
    return tuple(reports)


def download_lists(types: Sequence[MissionType], peer: Peer) -> Talk["Lists"]:
    """Download the lists of `types`, each that comes.

    A vehicle that has no fence or rally points at all is one that has none stored. Where not even
    the first list comes, and it is not refused, the others are not asked for.
    """
    items: dict[MissionType, tuple[WireItem, ...]] = {}
    missing: dict[MissionType, Outcome] = {}
    for part in types:
        outcome = yield from read_list(peer, part)
        absent = part is not MissionType.MISSION and outcome.result in ABSENT
        if outcome.status == "accepted" or absent:
            items[part] = outcome.items
            continue
        missing[part] = outcome
        if outcome.status != "refused" and not items:
            break
    return Lists(items, missing)


def clear_lists(types: Sequence[MissionType], peer: Peer) -> Talk[tuple[PartReport, ...]]:
    """Clear the lists of `types`, fence or rally points, and read back that they are empty."""
    reports = []
    for part in types:
        cleared = yield from clear_list(peer, part)
        report = _unread(part, 0, cleared, 1)
        if cleared.status in ("accepted", "silent"):
            read = yield from read_list(peer, part)
            if read.status == "accepted":
                differences = compare((), read.items, part, peer.vehicle)
                verdict: PartVerdict = "different" if differences else "verified"
                report = replace(report, verdict=verdict, differences=differences)
        reports.append(report)
        if report.verdict in ("silent", "armed", "cancelled"):
            break
    return tuple(reports)


def _upload_part(part: MissionType, items: tuple[WireItem, ...], peer: Peer) -> Talk[PartReport]:
    """Return what became of a list."""
    number = len(items) - home_items(peer.vehicle, part)
    attempt, final = 0, False
    while not final:
        attempt += 1
        sent = yield from send_list(items, peer, part)
        report = _unread(part, number, sent, attempt)
        if sent.status in ("accepted", "unknown"):
            read = yield from read_list(peer, part)
            if read.status == "accepted":
                differences = compare(items, read.items, part, peer.vehicle)
                right = all(difference.kind != "wrong" for difference in differences)
                # A doubtful refusal is about a duplicate if the list is right, else about an item.
                refused = not right and sent.result in TENTATIVE
                report = replace(
                    report,
                    verdict="verified" if right else "refused" if refused else "different",
                    differences=differences,
                    result=None if right and sent.result in TENTATIVE else sent.result,
                    opaque_id=sent.opaque_id or read.opaque_id,
                )
            elif sent.status == "accepted":
                report = replace(report, said=read.said)
        # PX4 says ERROR when busy, and of packets that come late or twice: that may pass. So may
        # DENIED, but not if it is said of every announcement of a whole attempt.
        unheard = report.result == MavResult.DENIED and report.item is None
        refused = report.verdict == "refused" and (unheard or report.result not in TENTATIVE)
        final = refused or report.verdict in ("verified", "armed")
        final = final or attempt == peer.timeouts.attempts
    return report


def _unread(part: MissionType, items: int, outcome: Outcome, attempts: int) -> PartReport:
    """Return the report for `outcome` as long as nothing was read back."""
    status, result, said = outcome.status, outcome.result, outcome.said
    verdict: PartVerdict = (
        "unread" if status == "accepted" else "silent" if status == "unknown" else status
    )
    return PartReport(part, items, verdict, (), result, outcome.last_requested, attempts, said)


def explain(report: PartReport, peer: Peer, mission: Mission | None = None) -> str:
    """Return in words why the `report` of a list of `mission` is not verified."""
    home = home_items(peer.vehicle, report.part)
    rows = report.items + home
    match report.verdict:
        case "different":
            wrong = [str(each) for each in report.differences if each.kind == "wrong"]
            text = f"not what was sent: {listed(wrong)}"
        case "unread":
            text = "accepted, but it could not be read back; download it to see what is there"
        case "armed":
            text = "the vehicle is armed: nothing more is written (--allow-armed allows it)"
        case "silent":
            text = "the vehicle stopped answering"
            if report.item is not None:
                text += f" after it asked for item {report.item} of {rows}"
        case "cancelled":
            text = "the transfer was cancelled by the vehicle"
        case _:
            text = f"refused: {meaning(report.result or 0, peer.manners.meanings)}"
            if report.result == MavResult.NO_SPACE and peer.vehicle is not None:
                sure = peer.vehicle.dialect.items.sure
                with_home = " with home" if home else ""
                text += f": {rows} rows{with_home}, and a vehicle like this holds about {sure}"
            elif report.item is not None:
                text += f", at {_named(report.item - home, report.part, mission)}"
    if report.verdict != "different":
        text = f"{report.part.title}: {text}"
    if report.said:
        text += f". The vehicle says: {'; '.join(report.said)}"
    begun = report.item is not None and report.verdict not in ("different", "unread")
    if begun and peer.vehicle is not None and not peer.vehicle.dialect.atomic:
        text += f". {what_is_left(peer)}"
    return text


def _named(item: int, part: MissionType, mission: Mission | None) -> str:
    """Return what people call item `item` of a list, counted from behind the home row."""
    if item < 0:
        return "the home row"
    if part is not MissionType.MISSION or mission is None or item >= len(mission.items):
        return f"item {item}"
    return f"item {item} (command {mission.items[item].command})"


def what_is_left(peer: Peer) -> str:
    """Return in words what a vehicle may hold when a change of its lists has stopped half-way."""
    if peer.vehicle is None:
        return "What the vehicle holds now is not known: upload again, or download it"
    name = autopilot_name(peer.vehicle)
    if peer.vehicle.dialect.atomic:
        return f"{name} holds the old list or the new one, whole: download it to see which"
    return f"{name} may now hold old and new items mixed: upload again before flying"
