"""Mock autopilots answer as real ones did, exchange by exchange."""

import pytest
from exchanges import exchanges, played, recorded
from stations import VEHICLE, Desk, mock_of

from faao_mav.wire.messages import ListMessage, Message
from faao_mav.wire.protocol import GROUND_STATION


@pytest.mark.parametrize(
    ("kind", "aircraft", "real"),
    [
        ("ardupilot", "copter", "arducopter"),
        ("ardupilot", "plane", "arduplane"),
        ("px4-legacy-first", "copter", "px4"),
    ],
)
def test_the_mock_answers_as_the_real_one(kind: str, aircraft: str, real: str) -> None:
    desk = Desk(mock_of(kind, aircraft=aircraft), GROUND_STATION)
    desk.start()

    def talk(messages: list[Message], seconds: float, expected: int) -> list[Message]:
        said = [answer for message in messages for answer in desk.tell(message)]
        said += [] if messages else desk.wait(seconds)
        return [answer for answer in said if isinstance(answer, ListMessage)]

    for name, lines in exchanges(recorded(real)).items():
        assert (name, played(lines, talk, VEHICLE)) == (name, lines)
