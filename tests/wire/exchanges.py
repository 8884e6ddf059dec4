"""What autopilots answer in the mission protocol, and our client to them, as exchanges in words.

`tests/data/exchanges/` has one file for each autopilot: real ones gave the answers, and the mocks
are held to them. Each exchange begins with its name after `#`; a line `> ...` is what a ground
station sends, `~ SECONDS` is silence of it, and the lines `< ...` after it are the answers.

    count mission 2              MISSION_COUNT
    item mission 0 way           MISSION_ITEM_INT: one of `items.tsv`
    request mission 0            MISSION_REQUEST_INT
    list mission, clear mission  MISSION_REQUEST_LIST, MISSION_CLEAR_ALL
    ack mission ACCEPTED         MISSION_ACK
    beat 2 3 128                 HEARTBEAT: type, autopilot, flags
    text WORDS                   STATUSTEXT

Two files are made by hand, `mock.txt` and `client.txt`, in which `< ...` is what the vehicle says,
the lines `> ...` after it are the answers of the client, and `= ...` is how its job ends. Behind a
bar stands `from` or `to` whom else, by system and component.

`python tests/wire/exchanges.py arducopter` (or arduplane, px4) writes the answers of a real one
into the file. Each line waits for as many answers as the file has: what is new needs two runs.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from itertools import takewhile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from simulators import simulated
from stations import Desk

from faao_mav.wire import messages
from faao_mav.wire.discover import discover
from faao_mav.wire.link import WireLink
from faao_mav.wire.machine import AT_ONCE, Talk
from faao_mav.wire.messages import Message, WireItem
from faao_mav.wire.protocol import GROUND_STATION, Address, MavResult, MissionType

EXCHANGES = Path(__file__).parent.parent / "data" / "exchanges"
_FILES = {"arducopter": "ardupilot.txt", "arduplane": "ardupilot.txt", "px4": "px4.txt"}

QUIET = 0.1
"""Seconds without a word after which an autopilot says nothing: chosen, below the 0.25 s after
which PX4 asks again."""

PATIENCE = 2.0
"""Seconds that an answer may take on a busy machine."""


def _items() -> Iterator[tuple[str, WireItem]]:
    """Yield the items that are sent, by their names in `items.tsv`."""
    for line in (EXCHANGES / "items.tsv").read_text().splitlines()[1:]:
        name, command, frame, *params, x, y, z = line.split("\t")
        one, two, three, four = map(float, params)
        place = int(x), int(y), float(z)
        yield name, WireItem(int(command), int(frame), (one, two, three, four), *place)


ITEMS = dict(_items())


def exchanges(text: str) -> dict[str, list[str]]:
    """Return the lines of each exchange in `text`, by its name."""
    found: dict[str, list[str]] = {}
    for line in text.splitlines():
        if line.startswith("# "):
            lines = found.setdefault(line[2:], [])
        elif line:
            lines.append(line)
    return found


def played(
    lines: list[str], tell: Callable[[str, int], Sequence[Message]], answers: str = "<"
) -> list[str]:
    """Return `lines` with the answers that `tell` gives in place of those that they have.

    It is told each line that is none, and how many answers that has.
    """
    out = list[str]()
    for at, line in enumerate(lines):
        if not line.startswith(answers):
            had = takewhile(lambda each: each.startswith(answers), lines[at + 1 :])
            said = tell(line, len([*had]))
            out += [line, *(f"{answers} {written(each)}" for each in said)]
    return out


def at_desk(desk: Desk, to: Address) -> Callable[[str, int], list[Message]]:
    """Return what tells the machine on a `desk`, at the address `to`, the lines of an exchange."""

    def tell(line: str, _: int) -> list[Message]:
        text, _bar, who = line[2:].partition(" | ")
        other = Address(*map(int, who.split()[1:])) if who else None
        sender, target = (other if who.startswith(each) else None for each in ("from", "to"))
        said: Sequence[Message] = ()
        match line[0]:
            case "b":
                said = desk.start()
            case "c":
                said = desk.machine.cancel(desk.now)
            case "~":
                said = desk.wait(float(text))
            case "=":
                end = desk.machine.outcome
                result = "no result" if end.result is None else MavResult(end.result).name
                assert text == "; ".join([f"{end.verdict} at {end.item}, {result}", *end.said])
            case _:
                said = desk.tell(parsed(text, target or to), sender)
        kinds = messages.ListMessage | messages.Statustext
        return [each for each in said if isinstance(each, kinds)]

    return tell


def parsed(text: str, to: Address) -> Message:
    """Return the message that `text` says."""
    match text.split():
        case ["count", part, number]:
            return messages.MissionCount(to, _type(part), int(number))
        case ["item", part, number, row]:
            return messages.MissionItemInt(to, _type(part), int(number), ITEMS[row])
        case ["request", part, number]:
            return messages.MissionRequestInt(to, _type(part), int(number))
        case ["list", part]:
            return messages.MissionRequestList(to, _type(part))
        case ["clear", part]:
            return messages.MissionClearAll(to, _type(part))
        case ["ack", part, result]:
            return messages.MissionAck(to, _type(part), MavResult[result])
        case ["beat", kind, autopilot, flags]:
            return messages.Heartbeat(int(kind), int(autopilot), int(flags), 0, 4)
        case ["text", *words]:
            return messages.Statustext(4, " ".join(words))
    raise ValueError(text)


def written(message: Message) -> str:
    """Return `message` in words."""
    if isinstance(message, messages.Statustext):
        return f"text {message.text}"
    assert isinstance(message, messages.ListMessage)
    number = message.mission_type
    part = next((each.name.lower() for each in MissionType if each == number), str(number))
    match message:
        case messages.MissionCount():
            return f"count {part} {message.count}"
        case messages.MissionRequestInt():
            legacy = " legacy" * isinstance(message, messages.MissionRequest)
            return f"request {part} {message.seq}{legacy}"
        case messages.MissionAck():
            return f"ack {part} {MavResult(message.type).name}"
        case messages.MissionItemInt(seq=seq, item=item):
            values = " ".join(f"{value:.7g}" for value in (*item.params, item.z))
            plain = f"{item.command} {item.frame} {item.x} {item.y}"
            return f"item {part} {seq}: {plain} {values} {item.autocontinue}"
    return f"{'list' if isinstance(message, messages.MissionRequestList) else 'clear'} {part}"


def _type(part: str) -> int:
    return int(part) if part.isdigit() else MissionType[part.upper()]


def conversation(said: list[Message], patience: float, expected: int) -> Talk[list[Message]]:
    """Send messages once, and return what is said about lists to it."""
    line = yield AT_ONCE
    line.say(*said)
    heard, until = list[Message](), line.now + (patience if expected else QUIET)
    while line.now < until and (not expected or len(heard) < expected):
        line = yield until
        message = None if line.heard is None else line.heard.message
        if isinstance(message, messages.ListMessage) and message.target == GROUND_STATION:
            heard.append(message)
    return heard


def recorded(kind: str) -> str:
    """Return the exchanges that are recorded of the real autopilot `kind`."""
    return (EXCHANGES / _FILES[kind]).read_text()


def renewed(kind: str, autopilots: Path, where: Path) -> str:
    """Return these exchanges with the answers that the real one gives now."""
    with simulated(autopilots, kind, where) as connection, WireLink(connection) as link:
        (found,) = link.run(discover(patience=20.0)).vehicles

        def tell(line: str, expected: int) -> list[Message]:
            # What is said late, on a busy machine, is waited for.
            silence = line.startswith("~")
            sent = [] if silence else [parsed(line[2:], found.address)]
            patience = max(float(line[2:]) if silence else 0.0, PATIENCE)
            return link.run(conversation(sent, patience, expected))

        return "\n\n".join(
            "\n".join([f"# {name}", *played(lines, tell)])
            for name, lines in exchanges(recorded(kind)).items()
        )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        text = renewed(sys.argv[1], Path(os.environ["FAAO_AUTOPILOTS"]), Path(folder))
    (EXCHANGES / _FILES[sys.argv[1]]).write_text(f"{text}\n")
