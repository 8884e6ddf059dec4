"""What a ground station does: upload and verify, download, clear."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from faao_mav.errors import InputError, LinkError
from faao_mav.mavlink.codec import read_key
from faao_mav.mavlink.discover import AskHome, Discovery, FoundVehicle, choose
from faao_mav.mavlink.link import Link, Observe
from faao_mav.mavlink.rows import mission_of, rows_of
from faao_mav.mavlink.transfer.pace import Timeouts
from faao_mav.mavlink.transfer.protocol import MissionType, Result, meaning
from faao_mav.mavlink.transfer.session import (
    PartReport,
    clear_lists,
    download_lists,
    explain,
    upload_parts,
)
from faao_mav.mavlink.transfer.transfer import Peer, Script
from faao_mav.mission.item import Mission
from faao_mav.vehicle import Vehicle
from faao_mav.vehicle.dialects import item_limit

_ABSENT = (Result.UNSUPPORTED, Result.INVALID)
"""What a vehicle answers that has no such list at all."""


@dataclass(frozen=True, slots=True)
class Options:
    """How to talk to a vehicle: whom, how patiently, and what of it to keep.

    `system` and `component` choose among several autopilots, `log` is a `.tlog` file to write,
    `signing_key` a file with the key for signed packets.
    """

    system: int | None = None
    component: int | None = None
    wait: float = 10.0
    log: Path | None = None
    signing_key: Path | None = None
    timeouts: Timeouts = Timeouts()  # noqa: RUF009


@dataclass(frozen=True, slots=True)
class UploadReport:
    """What became of an upload: one report for each list, `seconds` in all."""

    vehicle: FoundVehicle
    parts: tuple[PartReport, ...]
    seconds: float
    problems: tuple[str, ...]

    @property
    def verified(self) -> bool:
        """Whether everything is on the vehicle, whole and equal."""
        return not self.problems


def upload(
    mission: Mission,
    connection: str,
    *,
    system: int | None = None,
    component: int | None = None,
    allow_armed: bool = False,
    log: Path | None = None,
    signing_key: Path | None = None,
    wait: float = 10.0,
    timeouts: Timeouts | None = None,
    observe: Observe | None = None,
) -> UploadReport:
    """Put `mission` on the vehicle at `connection`, read it back and compare.

    Fence and rally points follow where the mission has them; else those of the vehicle stay as
    they are. The vehicle is found by its heartbeat within `wait` seconds, `system` and
    `component` choose among several. Nothing is armed or started. `log` is a `.tlog` file to
    write, `signing_key` a file with the key for signed packets.

    Raises `LinkError` if there is no such vehicle, or it is armed (replacing the mission in
    flight needs `allow_armed`), or the link breaks; `InputError` for what cannot be sent.
    """
    if not mission.items:
        raise InputError("upload: the mission has no items; clear the vehicle's instead")
    options = Options(system, component, wait, log, signing_key, timeouts or Timeouts())
    with _open(connection, options) as link:
        started = time.monotonic()
        vehicle, peer = _find(link, connection, options, observe)
        _check_disarmed(vehicle, connection, allow_armed)
        lists = [(part, rows_of(mission, part, peer.firmware)) for part in MissionType]
        parts = [(part, rows) for part, rows in lists if rows]
        script = Script(upload_parts(parts, peer, vehicle.kind, options.timeouts))
        reports = link.run(script, observe)
        seconds = time.monotonic() - started
        problems = _problems(reports, vehicle, peer, mission, link.lacks_key)
    return UploadReport(vehicle, reports, seconds, problems)


def download(
    connection: str,
    *,
    system: int | None = None,
    component: int | None = None,
    log: Path | None = None,
    signing_key: Path | None = None,
    wait: float = 10.0,
    timeouts: Timeouts | None = None,
    observe: Observe | None = None,
) -> Mission:
    """Return the mission, fence and rally points of the vehicle at `connection`.

    Home is ArduPilot's row 0, or what PX4 says when asked. Arguments as in `upload`. Raises
    `LinkError` if there is no such vehicle or a list does not come whole; a vehicle that has no
    fence or rally points at all is one that has none stored.
    """
    options = Options(system, component, wait, log, signing_key, timeouts or Timeouts())
    with _open(connection, options) as link:
        vehicle, peer = _find(link, connection, options, observe)
        script = Script(download_lists(tuple(MissionType), peer, options.timeouts))
        lists = link.run(script, observe)
        for part, outcome in lists.missing.items():
            absent = part is not MissionType.MISSION and outcome.result in _ABSENT
            if not absent:
                reason = "the vehicle stopped answering"
                if outcome.result is not None:
                    reason = f"refused: {meaning(outcome.result, peer.firmware)}"
                raise LinkError(f"{connection}: {part.title}: not read: {reason}")
        rows = [lists.rows.get(part, ()) for part in MissionType]
        try:
            mission = mission_of(rows[0], rows[1], rows[2], peer.firmware)
        except InputError as error:
            raise LinkError(
                f"{connection}: what the vehicle holds is no mission: {error}"
            ) from None
        if mission.home is None:
            homes = link.run(AskHome(vehicle.address), observe)
            mission = replace(mission, home=homes[0] if homes else None)
    return mission


def clear(
    connection: str,
    *,
    types: Sequence[MissionType] = tuple(MissionType),
    system: int | None = None,
    component: int | None = None,
    allow_armed: bool = False,
    log: Path | None = None,
    signing_key: Path | None = None,
    wait: float = 10.0,
    timeouts: Timeouts | None = None,
    observe: Observe | None = None,
) -> UploadReport:
    """Clear lists of the vehicle at `connection` and read back that they are empty.

    Arguments and errors as in `upload`.
    """
    options = Options(system, component, wait, log, signing_key, timeouts or Timeouts())
    with _open(connection, options) as link:
        started = time.monotonic()
        vehicle, peer = _find(link, connection, options, observe)
        _check_disarmed(vehicle, connection, allow_armed)
        script = Script(clear_lists(types, peer, options.timeouts))
        reports = link.run(script, observe)
        seconds = time.monotonic() - started
        problems = _problems(reports, vehicle, peer, Mission(()), link.lacks_key)
    return UploadReport(vehicle, reports, seconds, problems)


def _open(connection: str, options: Options) -> Link:
    key = None if options.signing_key is None else read_key(options.signing_key)
    return Link(connection, key=key, log=options.log)


def _find(
    link: Link, connection: str, options: Options, observe: Observe | None
) -> tuple[FoundVehicle, Peer]:
    search = Discovery(
        options.system, options.component, patience=options.wait, boot=options.timeouts.boot
    )
    found = link.run(search, observe)
    vehicle = choose(found, connection, options.system, options.component, options.wait)
    return vehicle, Peer(link.address, vehicle.address, vehicle.firmware)


def _check_disarmed(vehicle: FoundVehicle, connection: str, allow_armed: bool) -> None:
    if vehicle.armed and not allow_armed:
        raise LinkError(
            f"{connection}: {vehicle}: the mission of an armed vehicle is not replaced; disarm "
            "it, or allow it (--allow-armed)"
        )


def _problems(
    reports: Sequence[PartReport],
    vehicle: FoundVehicle,
    peer: Peer,
    mission: Mission,
    lacks_key: bool,
) -> tuple[str, ...]:
    limit = 0
    if peer.firmware != "generic":
        limit = item_limit(Vehicle(peer.firmware, vehicle.kind)).sure

    def describe(item: int) -> str:
        if item < 0:
            return "the home row"
        if item >= len(mission.items):
            return f"item {item}"
        return f"item {item} (command {mission.items[item].command})"

    failed = [report for report in reports if not report.verified]
    problems = [
        explain(report, peer, limit, describe if report.part is MissionType.MISSION else str)
        for report in failed
    ]
    if lacks_key and any(report.verdict == "silent" for report in failed):
        problems.append("the vehicle signs its packets, and may want them signed: --signing-key")
    return tuple(problems)
