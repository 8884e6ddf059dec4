"""Signed links: whose packets are taken, and what a recording, another key or none is told as."""

import hashlib
import math
import os
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common
from served import vehicle
from stations import VEHICLE, Air, a_mission, hurry, signing_key

from faao_mav.errors import InputError, LinkError
from faao_mav.wire import upload
from faao_mav.wire.codec import Codec
from faao_mav.wire.messages import Heartbeat, Statustext
from faao_mav.wire.protocol import GROUND_STATION
from faao_mav.wire.signing import Signing, read_signing, remember

KEY = signing_key("open sesame")
TEXT = Statustext(6, "hello")
NOW = 1_800_000_000.0
"""A time after 2015, s since 1970."""


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    return path


def signing(key: bytes = KEY, latest: int = 0, at: float = NOW) -> Signing:
    return Signing(key, latest, lambda: at)


def signed(at: float = NOW, key: bytes = KEY) -> bytes:
    return Codec(VEHICLE, signing(key, at=at)).pack(TEXT)


def test_signed_packets_need_the_key() -> None:
    packet = signed()
    assert len(packet) == len(Codec(VEHICLE).pack(TEXT)) + 13
    reader = common.MAVLink(None)
    reader.signing.secret_key = KEY
    assert reader.parse_buffer(packet)[0].get_signed()
    unsigned = Codec(VEHICLE).pack(TEXT)
    for key, sent, verdict in (
        (KEY, packet, "signed"),
        (signing_key("wrong"), packet, "forged"),
        (KEY, unsigned, "unsigned"),
    ):
        codec = Codec(GROUND_STATION, signing(key))
        taken = [each.envelope and each.envelope.message for each in codec.parse(sent)]
        assert (taken, codec.heard) == ([TEXT] * (verdict == "signed"), {verdict})
    for k in range(len(packet)):
        damaged = packet[:k] + bytes([packet[k] ^ 1]) + packet[k + 1 :]
        assert not [x for x in Codec(GROUND_STATION, signing()).parse(damaged) if x.envelope], k


@settings(max_examples=20)
@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(0, 255)), max_size=20))
def test_a_packet_is_taken_that_is_younger_than_all_before(stream: list[tuple[int, int]]) -> None:
    """Whatever number its sender gives the link, and whatever forged ones say."""
    receiver, youngest = signing(), -math.inf
    assert receiver.judge(signed(NOW + 1e6, signing_key("wrong")), VEHICLE) == "forged"
    for step, link in stream:
        unsigned = signed(NOW + step)[:-13] + bytes([link]) + signed(NOW + step)[-12:-6]
        packet = unsigned + hashlib.sha256(KEY + unsigned).digest()[:6]
        expected = "signed" if step > youngest else "old"
        assert receiver.judge(packet, VEHICLE) == expected
        youngest = max(step, youngest)


def test_a_first_packet_is_at_most_a_minute_late_and_after_what_is_remembered() -> None:
    before = signing()
    assert before.judge(signed(NOW - 20), VEHICLE) == "signed"
    for latest, ago, verdict in (
        (0, 59, "signed"),
        (0, 61, "old"),
        (before.latest, 19, "signed"),
        (before.latest, 21, "old"),
    ):
        assert signing(latest=latest).judge(signed(NOW - ago), VEHICLE) == verdict


def test_what_is_no_key_file_or_is_not_its_owners_alone_is_refused(key_file: Path) -> None:
    assert read_signing(key_file).key == KEY
    key_file.write_text(KEY.hex() + "\n")
    before = read_signing(key_file)
    assert before.key == KEY
    # The last time is kept beside the key.
    before.latest = 77
    remember(key_file, before)
    assert read_signing(key_file).latest == 77
    beside = key_file.with_name("key.last")
    for nonsense in ("soon", "-1", f"{2**48}", "", "²"):
        beside.write_text(nonsense)
        with pytest.raises(InputError, match=r"key\.last: expected the time of the last packet"):
            read_signing(key_file)
    key_file.write_text("open sesame")
    with pytest.raises(InputError, match="expected a signing key: 32 bytes, or 64 hex") as caught:
        read_signing(key_file)
    assert "sesame" not in str(caught.value)
    os.mkfifo(key_file.with_name("PIPE"))
    for path in ("/dev/urandom", "PIPE", ".", "none", "-"):
        with pytest.raises(InputError, match=r"is a device or a pipe|cannot be read"):
            read_signing(key_file.parent / path)
    for mode in (0o640, 0o604, 0o620):
        key_file.chmod(mode)
        with pytest.raises(InputError, match=rf"mode {mode:o}\); .*: chmod 600 {key_file}"):
            read_signing(key_file)


def test_a_signed_session_and_what_is_none(key_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No key, another one, or a recording is told as such."""
    with vehicle("px4", key=KEY) as (connection, _):
        for _ in range(2):  # the second is after what is remembered of the first
            assert upload(a_mission(5), connection, system=1, signing_key=key_file).verified
        hurry(monkeypatch)
        problem = upload(a_mission(5), connection, system=1).problems[-1]
        assert "signs its packets" in problem
    for theirs, latest, told in (
        (signing_key("other"), 0, r"signed with another key than the one in .*key$"),
        (None, 0, "packets come that are not signed: .* or leave out --signing-key"),
        (KEY, 2**48 - 1, "no vehicle: packets come .* of a recording"),
    ):
        key_file.with_name("key.last").write_text(f"{latest}")
        with vehicle("px4", key=theirs) as (to, _), pytest.raises(LinkError, match=told):
            upload(a_mission(5), to, signing_key=key_file, wait=2.0)


def test_a_heartbeat_is_not_enough_to_be_alive(
    key_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A vehicle that is signed, and says nothing else: what a recording of heartbeats shows."""
    codec = Codec(VEHICLE, Signing(KEY))

    def beats(data: bytes | None) -> list[tuple[bytes, str]]:
        time.sleep(0.02)
        return [(codec.pack(Heartbeat(2, 12, 0, 0, 3)), "")] if data is None else []

    monkeypatch.setattr("faao_mav.wire.link.open_transport", lambda _: Air(beats, listens=False))
    hurry(monkeypatch)
    with pytest.raises(LinkError, match="no answer to a question that was never asked before"):
        upload(a_mission(5), "udpout:127.0.0.1:9", system=1, signing_key=key_file)


def test_times_of_sent_packets_grow_whatever_the_clock_does() -> None:
    clock = iter([NOW, NOW, NOW - 1000, NOW - 1000])
    sender = Signing(KEY, clock=lambda: next(clock))
    ticks = [sender.next_tick() for _ in range(3)]
    assert ticks == [ticks[0], ticks[0] + 1, ticks[0] + 2]
    heard = signing()
    heard.judge(signed(NOW + 50), VEHICLE)
    assert heard.next_tick() == ticks[0] + 5_000_001  # the guide: after all that was heard
