"""What a ground station does: upload and verify, download."""

import secrets
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypedDict, Unpack

from faao_mav.autopilot.files import MadeFor, addressee_mistake
from faao_mav.errors import InputError, LinkError
from faao_mav.mission.item import Mission
from faao_mav.wire.discover import FoundVehicle, choose, discover
from faao_mav.wire.jobs import UploadReport, explain, read_held, upload_parts, what_is_left
from faao_mav.wire.link import Observe, WireLink
from faao_mav.wire.machine import Talk, ask_alive, ask_for
from faao_mav.wire.messages import GlobalPositionInt
from faao_mav.wire.parameters import check_settable, set_parameters
from faao_mav.wire.protocol import GROUND_STATION, POSITION, Address, MissionType, meaning
from faao_mav.wire.signing import Verdict, read_signing, remember
from faao_mav.wire.transfer import PartReport, Peer
from faao_mav.wire.transport import parse_connection
from faao_mav.wire.whereabouts import Whereabouts, place_in
from faao_mav.wire.wire_items import mission_of, wire_items

_PASSED_OVER: dict[Verdict, str] = {
    "forged": "packets come that are signed with another key than the one in {key}",
    "old": (
        "packets come that are signed with this key, but not later than those before: of a "
        "recording, or of a vehicle whose clock is behind and that does not hear this station"
    ),
    "unsigned": (
        "packets come that are not signed: set the vehicle up to sign them with this key, or leave "
        "out --signing-key"
    ),
}
"""Why no vehicle is heard where packets come that have to be signed."""


class LinkOptions(TypedDict, total=False):
    """How to talk to a vehicle: what `upload` and `download` have in common.

    `system` and `component` choose among several autopilots; the vehicle is found by its heartbeat
    within `wait` seconds (10). `own_system` is the number to speak as, for a vehicle that takes
    orders of a certain one only (`GROUND_STATION` has the usual one). `log` is a `.tlog` file to
    write, `signing_key` a file with the key for signed packets, beside which the time of the last
    one is kept. `observe` is told what is going on, how much of it is done, and of how much;
    `note`, in words, what goes wrong beside it: a log that ends early, packets that do not count.
    Without `note` that is a Python warning.
    """

    system: int | None
    component: int | None
    own_system: int | None
    log: Path | None
    signing_key: Path | None
    wait: float
    observe: Observe | None
    note: Callable[[str], object] | None


def upload(
    mission: Mission,
    connection: str,
    *,
    allow_armed: bool = False,
    made_for: MadeFor | None = None,
    parameters: Mapping[str, float] | None = None,
    clear_rest: bool = False,
    **options: Unpack[LinkOptions],
) -> UploadReport:
    """Put `mission` on the vehicle at `connection`, read it back and compare.

    Fence and rally points follow where the mission has them; else those of the vehicle stay as
    they are, or are cleared with `clear_rest`. With `parameters`, which have to be a mission's own
    (see `check_settable`), these are set and read back before. Nothing is armed or started.
    `options` are those of `LinkOptions`.

    Raises `LinkError` if there is no such vehicle, it is another one than the mission was
    `made_for`, it is armed (replacing the mission in flight needs `allow_armed`), or the link
    breaks; `InputError` for what cannot be sent.

    >>> from faao_mav import read_mission
    >>> mission = read_mission("tests/data/missions/plain.waypoints")
    >>> upload(mission, "udpout:127.0.0.1:9", wait=0.1)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.LinkError: udpout:127.0.0.1:9: no heartbeat of an autopilot ...
    """
    if not mission.items:
        raise InputError("upload: the mission has no items")
    check_settable(parameters or {}, "parameters")
    with Session(connection, **options) as session:
        found, peer = session.found, session.peer
        if found.armed and not allow_armed:
            told = "the mission of an armed vehicle is not replaced; disarm it, or allow it"
            raise LinkError(f"{connection}: {found}: {told} (--allow-armed)")
        if made_for is not None and peer.vehicle is not None:
            mistake = addressee_mistake(made_for, peer.vehicle)
            if mistake is not None:
                raise LinkError(f"{connection}: {mistake}: nothing is uploaded")
        peer.may_be_armed = allow_armed
        lists = {part: wire_items(mission, part, peer.vehicle) for part in MissionType}
        parts = [each for each in lists.items() if each[1] or clear_rest]

        def put() -> Talk[UploadReport]:
            told = yield from ask_for(peer.address, POSITION, GlobalPositionInt)
            changes, problem = yield from set_parameters(parameters or {}, peer)
            reports = () if problem else (yield from upload_parts(parts, peer))
            problems = [problem] if problem else []
            for each in (each for each in reports if not each.verified):
                unheard = each.verdict == "silent" and each.item is None
                why = session.why_silent() if unheard else ""
                problems.append(explain(each, peer, mission) + why)
            place = None if told is None else place_in(told)
            stands = None if place is None else Whereabouts.of(place, mission)
            seconds = time.monotonic() - session.started
            return UploadReport(found, reports, seconds, tuple(problems), stands, changes)

        try:
            return session.run(put())
        except LinkError as error:
            raise LinkError(f"{error}. {what_is_left(peer)}") from None


@dataclass(frozen=True, slots=True)
class Holdings:
    """What a vehicle holds, as far as it could be read; `problems` say why a list is missing.

    A missing fence or missing rally points are among `Mission.unread`.
    """

    vehicle: FoundVehicle
    mission: Mission
    problems: tuple[str, ...]


def download(connection: str, **options: Unpack[LinkOptions]) -> Mission:
    """Return the mission, fence and rally points of the vehicle at `connection`.

    See `holdings`; raises `LinkError` where one of them does not come whole, too.

    >>> download("udpout:127.0.0.1:9", wait=0.1)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.LinkError: udpout:127.0.0.1:9: no heartbeat of an autopilot ...
    """
    found = holdings(connection, **options)
    if found.problems:
        raise LinkError(f"{connection}: {found.problems[0]}")
    return found.mission


def holdings(connection: str, **options: Unpack[LinkOptions]) -> Holdings:
    """Return the vehicle at `connection`, and the mission, fence and rally points that it holds.

    Home is ArduPilot's item 0, or what PX4 says when asked. `options` are those of `LinkOptions`.
    Raises `LinkError` if there is no such vehicle or its mission does not come whole; a vehicle
    that has no fence or rally points at all is one that has none stored.
    """
    with Session(connection, **options) as session:
        held = session.run(read_held(session.peer, parameters=False))
        missing = {part: session.not_read(report) for part, report in held.missing.items()}
        if MissionType.MISSION in missing:
            raise LinkError(f"{connection}: {missing[MissionType.MISSION]}")
        try:
            mission = mission_of(held.lists, session.peer.vehicle)
        except InputError as error:
            told = f"what the vehicle holds is no mission: {error}"
            raise LinkError(f"{connection}: {told}") from None
    unread = tuple(part.title for part in missing)
    mission = replace(mission, home=held.home or mission.home, unread=unread)
    return Holdings(session.found, mission, tuple(missing.values()))


class Session(WireLink):
    """A link to the one vehicle that has been found; to be used in a `with` statement."""

    def __init__(self, connection: str, **options: Unpack[LinkOptions]) -> None:
        self.started = time.monotonic()
        self._key_file = options.get("signing_key")
        self._signing = None if self._key_file is None else read_signing(self._key_file)
        own = options.get("own_system") or GROUND_STATION.system
        super().__init__(
            connection,
            signing=self._signing,
            log=options.get("log"),
            address=Address(own, GROUND_STATION.component),
            note=options.get("note") or warnings.warn,
            observe=options.get("observe") or (lambda *_: None),
        )
        try:
            self.found = self._found(connection, options)
            self.bind(self.found.address, *self.found.origins)
            alive = ask_alive(self.found.address, secrets.randbits(62))
            if self._signing is not None and not self.run(alive):  # a recording of such a session
                told = "no answer to a question that was never asked before (TIMESYNC)"
                where = "is the vehicle there, or a recording of it?"
                raise LinkError(f"{connection}: {self.found}: {told}: {where}")
        except BaseException:
            self.close()
            raise
        self.peer = Peer(self.address, self.found.address, self.found.vehicle)

    def close(self) -> None:
        """Let go of the link; say what became of the log, keep the time of the last packet."""
        super().close()
        if self._signing is not None and self._key_file is not None:
            remember(self._key_file, self._signing)
        if self.log is not None and self.log.failure is not None:
            self._note(self.log.failure)

    def _found(self, connection: str, options: LinkOptions) -> FoundVehicle:
        """Return the vehicle; raises `LinkError`."""
        which, wait = (options.get("system"), options.get("component")), options.get("wait", 10.0)
        knocks = parse_connection(connection).kind == "serial"
        heard = self.run(discover(*which, patience=wait, listens=self.listens, knocks=knocks))
        for verdict, text in _PASSED_OVER.items():
            if self._signing and not heard.vehicles and verdict in self.codec.heard:
                raise LinkError(f"{connection}: no vehicle: {text.format(key=self._key_file)}")
        return choose(heard, connection, *which, wait)

    def not_read(self, report: PartReport) -> str:
        """Return in words why a list was not read."""
        why = "the vehicle stopped answering"
        if report.result is not None:
            why = f"refused: {meaning(report.result, self.peer.manners.meanings)}"
        elif report.part is MissionType.MISSION:
            why += self.why_silent()
        return f"{report.part.title}: not read: {why}"

    def why_silent(self) -> str:
        """Return why the vehicle may never answer, in words; "" where nothing hints at it."""
        if self.strangers:
            origins = " and ".join(sorted(self.strangers))
            return f"; packets in its name come from {origins}: begin again if it is there now"
        if self._signing is None and "signed" in self.codec.heard:
            return "; it signs its packets, and may want them signed: --signing-key"
        family = self.found.family
        if self.found.address not in self.codec.modern:
            where = f": {family.mavlink_2}" if family and family.mavlink_2 else ""
            return f"; it speaks MAVLink 1 only: set its port to MAVLink 2{where}"
        return f"; {family.only_one_station}" if family and family.only_one_station else ""
