"""Whole jobs on a vehicle, as talks: upload, clear and verify, download everything; in words."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from faao_mav.errors import counted
from faao_mav.mission.item import Mission
from faao_mav.wire.discover import FoundVehicle
from faao_mav.wire.machine import Talk
from faao_mav.wire.messages import WireItem
from faao_mav.wire.parameters import Change
from faao_mav.wire.protocol import MavResult, MissionType, listed, meaning
from faao_mav.wire.transfer import (
    ATTEMPTS,
    TENTATIVE,
    PartReport,
    Peer,
    read_list,
    send_list,
)
from faao_mav.wire.whereabouts import Whereabouts
from faao_mav.wire.wire_items import compare, home_items

_ABSENT = frozenset({MavResult.UNSUPPORTED, MavResult.INVALID})
"""What a vehicle answers that has no such list at all."""

_NOT_NOW = MavResult.DENIED, None
"""The result, and the item, of an upload whose every announcement is denied."""


@dataclass(frozen=True, slots=True)
class UploadReport:
    """What became of an upload: one report for each list, `seconds` in all.

    `stands` is where the vehicle stands beside the mission, None where it does not tell; `changes`
    are the parameters that were set.
    """

    vehicle: FoundVehicle
    parts: tuple[PartReport, ...]
    seconds: float
    problems: tuple[str, ...]
    stands: Whereabouts | None = None
    changes: tuple[Change, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether everything is on the vehicle, whole and equal."""
        return not self.problems

    def __str__(self) -> str:
        """Return it for people, in lines."""
        stands = "not known how far from the mission's home: it does not tell where it is"
        if self.stands is not None:
            stands = f"{self.stands}{'' if self.stands.is_meant else ': it is not armed there'}"
        lines = [f"vehicle      {self.vehicle}", f"stands       {stands}"]
        lines += [f"parameter    {change}" for change in self.changes]
        for part in self.parts:
            if part.verified:
                again = "" if part.attempts == 1 else f", in {part.attempts} attempts"
                stored = f"{counted(part.items, 'item')} stored{again}"
                lines.append(f"{part.part.title.split()[0]:<13}{stored}")
        lines += [f"not kept     {text}" for part in self.parts for text in _dropped(part)]
        lines += [f"failed       {problem}" for problem in self.problems]
        if self.verified:
            took = f"the upload took {self.seconds:.1f} s"
            lines.append(f"verified     read back and compared; {took}")
        return "\n".join(lines)


def _dropped(part: PartReport) -> list[str]:
    """Return what storage lost, one line for each field."""
    lost = [each for each in part.differences if each.kind == "dropped"]
    fields = Counter(each.field for each in lost)
    firsts = {each.field: each for each in reversed(lost)}
    return [
        str(firsts[field]) + (f" (and so in {count - 1} more items)" if count > 1 else "")
        for field, count in fields.items()
    ]


Lists: TypeAlias = tuple[dict[MissionType, tuple[WireItem, ...]], dict[MissionType, PartReport]]
"""The lists that were downloaded, and why others were not."""


def upload_parts(
    parts: Sequence[tuple[MissionType, tuple[WireItem, ...]]], peer: Peer
) -> Talk[tuple[PartReport, ...]]:
    """Upload lists one after the other, or clear those without items, read each back and compare.

    It stops at the first failure. That a list cannot be cleared which the vehicle does not have at
    all is none. A transfer that the link broke is begun again, and one whose last answer was lost
    or whose list reads back differently too (ArduPilot now and then loses a fence that it
    accepted), at most `ATTEMPTS` times. A refusal is final, except one that may be about
    something else.
    """
    reports: list[PartReport] = []
    for part, items in parts:
        report = yield from _upload_part(part, items, peer)
        if items or report.result not in _ABSENT:
            reports.append(report)
            if not report.verified:
                break
    return tuple(reports)


def _upload_part(part: MissionType, items: tuple[WireItem, ...], peer: Peer) -> Talk[PartReport]:
    rows = len(items[home_items(peer.vehicle, part) :])
    for attempt in range(1, ATTEMPTS + 1):
        report = yield from send_list(items, peer, part)
        if report.verdict in ("accepted", "unknown"):
            report = _read_back(report, items, (yield from read_list(peer, part)), peer)
        report = replace(report, items=rows, attempts=attempt)
        # PX4 says ERROR when busy, and of packets that come late or twice: that may pass. So may
        # DENIED, but not if it is said of every announcement of a whole attempt.
        passes = report.result in TENTATIVE and (report.result, report.item) != _NOT_NOW
        if report.verdict in ("verified", "armed") or (report.verdict == "refused" and not passes):
            break
    return report


def _read_back(
    sent: PartReport, items: tuple[WireItem, ...], read: PartReport, peer: Peer
) -> PartReport:
    """Return what became of `items` that were sent, by what was read of them."""
    said = sent.said or read.said
    if read.verdict != "accepted":
        return replace(
            sent, verdict="unread" if sent.verdict == "accepted" else "silent", said=said
        )
    differences = compare(items, read.found, sent.part, peer.vehicle)
    told = replace(sent, differences=differences, said=said)
    doubtful = sent.result in TENTATIVE
    if any(each.kind == "wrong" for each in differences):
        return replace(told, verdict="refused" if doubtful else "different")
    # A doubtful refusal is about a duplicate if the list is right, else about an item.
    return replace(told, verdict="verified", result=None if doubtful else sent.result)


def download_lists(types: Sequence[MissionType], peer: Peer) -> Talk[Lists]:
    """Download the lists of `types`, each that comes.

    A vehicle that has no fence or rally points at all is one that has none stored. Where not even
    the first list comes, and it is not refused, the others are not asked for.
    """
    lists, missing = dict[MissionType, tuple[WireItem, ...]](), dict[MissionType, PartReport]()
    for part in types:
        report = yield from read_list(peer, part)
        absent = part is not MissionType.MISSION and report.result in _ABSENT
        if report.verdict == "accepted" or absent:
            lists[part] = report.found
            continue
        missing[part] = report
        if report.verdict != "refused" and not lists:
            break
    return lists, missing


def explain(report: PartReport, peer: Peer, mission: Mission | None = None) -> str:
    """Return in words why the `report` of a list of `mission` is not verified."""
    home, part, holds = home_items(peer.vehicle, report.part), report.part, ""
    rows = report.items + home
    if report.item is not None and peer.vehicle is not None and not peer.vehicle.dialect.atomic:
        holds = f". {what_is_left(peer)}"
    match report.verdict:
        case "different":
            wrong = [str(each) for each in report.differences if each.kind == "wrong"]
            text, holds = f"not what was sent: {listed(wrong)}", ""
        case "unread":
            text = "accepted, but it could not be read back; download it to see what is there"
            holds = ""
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
                number = report.item - home
                text += f", at item {number}" if number >= 0 else ", at the home row"
                if part is MissionType.MISSION and mission and 0 <= number < len(mission.items):
                    text += f" (command {mission.items[number].command})"
    said = f". The vehicle says: {'; '.join(report.said)}" if report.said else ""
    return f"{part.title}: {text}{said}{holds}"


def what_is_left(peer: Peer) -> str:
    """Return in words what a vehicle may hold when a change of its lists has stopped half-way."""
    if peer.vehicle is None:
        return "What the vehicle holds now is not known: upload again, or download it"
    name = peer.vehicle.family.name
    if peer.vehicle.dialect.atomic:
        return f"{name} holds the old list or the new one, whole: download it to see which"
    return f"{name} may now hold old and new items mixed: upload again before flying"
