"""Whole jobs on a vehicle, as talks: upload, clear and verify, read what it holds; in words."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from faao_mav.autopilot import VehicleType
from faao_mav.errors import InputError, counted
from faao_mav.mission.item import Home, Mission
from faao_mav.wire import transfer
from faao_mav.wire.discover import FoundVehicle
from faao_mav.wire.machine import Talk, ask_for
from faao_mav.wire.messages import HomePosition, WireItem
from faao_mav.wire.parameters import Change, Reading, read_parameters
from faao_mav.wire.protocol import HOME_POSITION, MavResult, MissionType, listed, meaning
from faao_mav.wire.transfer import ATTEMPTS, PartReport, Peer
from faao_mav.wire.whereabouts import Whereabouts, home_in
from faao_mav.wire.wire_items import Difference, compare, home_items

_ABSENT = frozenset({MavResult.UNSUPPORTED, MavResult.INVALID})
"""What a vehicle answers that has no such list at all."""


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
        for part in self.parts:  # one line for each field that storage loses
            lost = dict[str, list[Difference]]()
            for each in part.differences:
                if each.kind == "dropped":
                    lost.setdefault(each.field, []).append(each)
            for first, *more in lost.values():
                so = f" (and so in {counted(len(more), 'more item')})" if more else ""
                lines.append(f"not kept     {first}{so}")
        lines += [f"failed       {problem}" for problem in self.problems]
        if self.verified:
            took = f"the upload took {self.seconds:.1f} s"
            lines.append(f"verified     read back and compared; {took}")
        return "\n".join(lines)


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
        rows = len(items[home_items(peer.vehicle, part) :])
        for attempt in range(1, ATTEMPTS + 1):
            report = yield from transfer.send_list(items, peer, part)
            if report.verdict in ("accepted", "unknown"):
                read = yield from transfer.read_list(peer, part)
                report = _read_back(report, items, read, peer)
            report = replace(report, items=rows, attempts=attempt)
            # PX4 says ERROR when busy, and of packets that come late or twice: that may pass. So
            # may DENIED, but not if it is said of every announcement of a whole attempt.
            denied = (report.result, report.item) == (MavResult.DENIED, None)
            passes = report.result in transfer.TENTATIVE and not denied
            final = report.verdict == "refused" and not passes
            if final or report.verdict in ("verified", "armed"):
                break
        if items or report.result not in _ABSENT:
            reports.append(report)
            if not report.verified:
                break
    return tuple(reports)


def _read_back(
    sent: PartReport, items: tuple[WireItem, ...], read: PartReport, peer: Peer
) -> PartReport:
    """Return what became of `items` that were sent, by what was read of them."""
    said = sent.said or read.said
    if read.verdict != "accepted":
        verdict: transfer.Verdict = "unread" if sent.verdict == "accepted" else "silent"
        return replace(sent, verdict=verdict, said=said)
    differences = compare(items, read.found, sent.part, peer.vehicle)
    told = replace(sent, differences=differences, said=said)
    doubtful = sent.result in transfer.TENTATIVE
    if any(each.kind == "wrong" for each in differences):
        return replace(told, verdict="refused" if doubtful else "different")
    # A doubtful refusal is about a duplicate if the list is right, else about an item.
    return replace(told, verdict="verified", result=None if doubtful else sent.result)


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """What the vehicle of a peer holds: `lists` as downloaded, its home row included.

    `missing` says why a list is not there; `home` is where it returns to, None where that is not
    known. `reading` is of its parameters.
    """

    lists: Mapping[MissionType, tuple[WireItem, ...]]
    reading: Reading
    missing: Mapping[MissionType, PartReport] = field(default_factory=dict)
    home: Home | None = None

    def other_than(
        self, sent: Sequence[WireItem], part: MissionType, vehicle: VehicleType
    ) -> tuple[Difference, ...]:
        """Return where one list is not `sent`, home included, but for what storage loses."""
        found = compare(sent, self.lists.get(part, ()), part, vehicle)
        return tuple(each for each in found if each.kind == "wrong")


def read_held(
    peer: Peer,
    parts: Sequence[MissionType] = tuple(MissionType),
    *,
    parameters: bool = True,
    home: bool = True,
) -> Talk[Held]:
    """Read the lists `parts` of the vehicle of `peer`, each that comes.

    A vehicle that has no fence or rally points at all is one that has none stored. Where not even
    the first list comes, and it is not refused, the others are not asked for. With `parameters`
    those are read that missions, failsafes and streams depend on. Its `home` is asked for with
    them, and without where it is no row of the mission.
    """
    lists, missing = dict[MissionType, tuple[WireItem, ...]](), dict[MissionType, PartReport]()
    for part in parts:
        report = yield from transfer.read_list(peer, part)
        absent = part is not MissionType.MISSION and report.result in _ABSENT
        if report.verdict == "accepted" or absent:
            lists[part] = report.found
            continue
        missing[part] = report
        if report.verdict != "refused" and not lists:
            break
    held, vehicle = Held(lists, Reading({}), missing), peer.vehicle
    if MissionType.MISSION not in lists:
        return held
    if parameters and vehicle is not None:
        names = [tuple(each.names) for each in vehicle.parameters.values()]
        names += [(name,) for each in vehicle.failsafes for name in each.defaults]
        if vehicle.modes.guided is not None:
            names += [(name,) for name in vehicle.family.setpoints.defaults]
        held = replace(held, reading=(yield from read_parameters(peer, names)))
    row = home_items(vehicle, MissionType.MISSION)
    if home and (parameters or not lists[MissionType.MISSION][:row]):
        told = yield from ask_for(peer.address, HOME_POSITION, HomePosition)
        with suppress(InputError):  # off the Earth
            held = replace(held, home=None if told is None else home_in(told))
    return held


def explain(report: PartReport, peer: Peer, mission: Mission | None = None) -> str:
    """Return in words why the `report` of a list of `mission` is not verified."""
    home, part, holds = home_items(peer.vehicle, report.part), report.part, ""
    rows, row = report.items + home, (report.item or 0) + (part is MissionType.MISSION) - home
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
                text += f" after it asked for item {row} of {rows}"
        case "cancelled":
            text = "the transfer was cancelled by the vehicle"
        case _:
            text = f"refused: {meaning(report.result or 0, peer.manners.meanings)}"
            if report.result == MavResult.NO_SPACE and peer.vehicle is not None:
                sure = peer.vehicle.dialect.items.sure
                many = f"{rows} rows{' with home' * home}"
                text += f": {many}, and a vehicle like this holds about {sure}"
            elif report.item is not None:
                text += f", at item {row}" if row >= home else ", at the home row"
                if part is MissionType.MISSION and mission and 0 < row <= len(mission.items):
                    text += f" (command {mission.items[row - 1].command})"
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
