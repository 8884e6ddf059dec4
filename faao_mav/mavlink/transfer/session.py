"""Whole jobs on a vehicle: upload and verify, download everything, clear and verify.

Each is a generator of machines for `Script`, so that it runs on a real link and on a simulated
one alike.
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

from faao_mav.mavlink.messages import Row
from faao_mav.mavlink.transfer.clear import Clear
from faao_mav.mavlink.transfer.download import Download
from faao_mav.mavlink.transfer.pace import Timeouts
from faao_mav.mavlink.transfer.protocol import MissionType, Result, meaning
from faao_mav.mavlink.transfer.transfer import Machine, Outcome, Peer
from faao_mav.mavlink.transfer.upload import Upload
from faao_mav.mavlink.transfer.verify import Difference, compare
from faao_mav.plan.autopilots import Kind

Verdict: TypeAlias = Literal["verified", "different", "unread", "refused", "silent", "cancelled"]

Steps: TypeAlias = Generator[Machine[Any], Outcome, "Lists"]


@dataclass(frozen=True, slots=True)
class PartReport:
    """What became of one list.

    `verdict`: "verified": the list was read back, and is what was sent but for what `differences`
    tell as dropped; "different": it is not; "unread": accepted, but could not be read back;
    otherwise it is not known to be there. `items` leaves out the home row. `attempts` counts
    uploads, `said` are the vehicle's own words.
    """

    part: MissionType
    items: int
    verdict: Verdict
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
    """What was downloaded; `missing` says why a list is not among `rows`."""

    rows: dict[MissionType, tuple[Row, ...]]
    missing: dict[MissionType, Outcome]


def upload_parts(
    parts: Sequence[tuple[MissionType, tuple[Row, ...]]],
    peer: Peer,
    kind: Kind = "copter",
    timeouts: Timeouts | None = None,
) -> Generator[Machine[Any], Outcome, tuple[PartReport, ...]]:
    """Upload lists one after the other, read each back and compare; stop at the first failure.

    A transfer that the link broke is begun again, and one whose last answer was lost or whose
    list reads back differently too, at most `Timeouts.attempts` times and not if it reads back
    the same again. A refusal is final,
    except an ERROR, which may be about something else.
    """
    reports: list[PartReport] = []
    for part, rows in parts:
        report = yield from _upload_part(part, rows, peer, kind, timeouts or Timeouts())
        reports.append(report)
        if not report.verified:
            break
    return tuple(reports)


def download_lists(
    types: Sequence[MissionType], peer: Peer, timeouts: Timeouts | None = None
) -> Steps:
    """Download the lists of `types`; stop at the first that does not come, unless refused."""
    rows: dict[MissionType, tuple[Row, ...]] = {}
    missing: dict[MissionType, Outcome] = {}
    for part in types:
        outcome = yield Download(peer, part, timeouts)
        if outcome.status == "accepted":
            rows[part] = outcome.rows
            continue
        missing[part] = outcome
        if outcome.status != "refused":
            break
    return Lists(rows, missing)


def clear_lists(
    types: Sequence[MissionType], peer: Peer, timeouts: Timeouts | None = None
) -> Generator[Machine[Any], Outcome, tuple[PartReport, ...]]:
    """Clear the lists of `types`, and read back that they are empty (but for the home row)."""
    reports = []
    for part in types:
        cleared = yield Clear(peer, part, timeouts)
        report = _failed(part, 0, cleared, 1)
        if cleared.status in ("accepted", "silent"):
            read = yield Download(peer, part, timeouts)
            if read.status == "accepted":
                left = len(read.rows) - _home_rows(part, peer)
                gone = Difference(part, None, "count", 0, left, "wrong")
                report = replace(
                    report,
                    verdict="different" if left > 0 else "verified",
                    differences=(gone,) if left > 0 else (),
                )
        reports.append(report)
        if report.verdict in ("silent", "cancelled"):
            break
    return tuple(reports)


def _upload_part(
    part: MissionType, rows: tuple[Row, ...], peer: Peer, kind: Kind, timeouts: Timeouts
) -> Generator[Machine[Any], Outcome, PartReport]:
    items = len(rows) - _home_rows(part, peer)
    last: PartReport | None = None
    for attempt in range(1, timeouts.attempts + 1):
        sent = yield Upload(rows, peer, part, timeouts)
        report = _failed(part, items, sent, attempt)
        if sent.status in ("accepted", "unknown"):
            read = yield Download(peer, part, timeouts)
            if read.status == "accepted":
                differences = compare(rows, read.rows, part, peer.firmware, kind)
                wrong = any(difference.kind == "wrong" for difference in differences)
                report = replace(
                    report,
                    verdict="different" if wrong else "verified",
                    differences=differences,
                    opaque_id=sent.opaque_id or read.opaque_id,
                )
                if sent.result == Result.ERROR:
                    # Of a reminder or a duplicate if the list is right, else of an item.
                    told = replace(report, verdict="refused")
                    report = told if wrong else replace(report, result=None)
            elif _by_us(read):
                return replace(report, verdict="cancelled")
            elif sent.status == "accepted":
                report = replace(report, verdict="unread", said=read.said)
        # PX4 says ERROR when busy, and of packets that come late or twice: that may pass.
        refused = report.verdict == "refused" and report.result != Result.ERROR
        if report.verified or refused or _by_us(sent) or _alike(report, last):
            return report
        last = report
    assert last is not None
    return last


def _failed(part: MissionType, items: int, outcome: Outcome, attempts: int) -> PartReport:
    """Return the report for `outcome` as long as nothing was read back."""
    verdicts: dict[str, Verdict] = {
        "accepted": "unread",
        "unknown": "silent",
        "refused": "refused",
        "silent": "silent",
        "cancelled": "cancelled",
    }
    verdict = verdicts[outcome.status]
    result, said = outcome.result, outcome.said
    return PartReport(part, items, verdict, (), result, outcome.item, attempts, said)


def _by_us(outcome: Outcome) -> bool:
    return outcome.status == "cancelled" and outcome.result is None


def _alike(one: PartReport, other: PartReport | None) -> bool:
    return other is not None and bool(one.differences) and one.differences == other.differences


def _home_rows(part: MissionType, peer: Peer) -> int:
    return int(part is MissionType.MISSION and peer.firmware == "ardupilot")


def explain(report: PartReport, peer: Peer, limit: int, describe: Callable[[int], str]) -> str:
    """Return in words why `report` is not verified.

    `limit` is how many rows the vehicle is thought to hold, `describe(item)` names an item.
    """
    part = report.part.title
    home = _home_rows(report.part, peer)
    text = f"{part}: "
    match report.verdict:
        case "different":
            wrong = [d for d in report.differences if d.kind == "wrong"]
            shown = "; ".join(str(difference) for difference in wrong[:5])
            more = f"; and {len(wrong) - 5} more" if len(wrong) > 5 else ""
            text = f"not what was sent: {shown}{more}"
        case "unread":
            text += "accepted, but it could not be read back; download it to see what is there"
        case "silent":
            text += "the vehicle stopped answering"
            if report.item is not None:
                text += f" after it asked for item {report.item} of {report.items + home}"
        case "cancelled":
            text += "the transfer was cancelled"
            text += "" if report.result is None else " by the vehicle"
        case _:
            assert report.result is not None
            text += f"refused: {meaning(report.result, peer.firmware)}"
            if report.result == Result.NO_SPACE:
                text += f": {report.items + home} rows"
                text += " with home" if home else ""
                text += f", and a vehicle like this holds about {limit}"
            elif report.item is not None:
                text += f", at {describe(report.item - home)}"
    if report.said:
        text += f". The vehicle says: {'; '.join(report.said)}"
    begun = report.item is not None and report.verdict in ("silent", "cancelled", "refused")
    if peer.firmware == "ardupilot" and begun:
        text += ". ArduPilot may now hold old and new items mixed: upload again before flying"
    return text
