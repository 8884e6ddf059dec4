"""What the commands share: options, exit statuses, messages."""

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from faao_mav.errors import FaaoError, InputError
from faao_mav.files import PAGES, check_apart, check_ending, check_writable

if TYPE_CHECKING:
    from faao_mav.mission.formats import MissionFile
    from faao_mav.plan import Vector


def option(value: str, text: str, *names: str, **limits: Any) -> Any:
    """Return an option: what its value is called in the help, and what the option does."""
    return typer.Option(*names, metavar=value, help=text, **limits)


def flag(name: str, text: str) -> Any:
    """Return an option without a value: its name, and what it does."""
    return typer.Option(name, help=text)


VEHICLE = "The vehicle: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or DEVICE,BAUD."
"""The help of an option for a vehicle's connection."""

Number: TypeAlias = float | None
File: TypeAlias = Path | None
System: TypeAlias = Annotated[
    int | None, option("N", "The vehicle's system number.", min=1, max=255)
]
AllowArmed: TypeAlias = Annotated[
    bool, flag("--allow-armed", "Replace the mission of an armed vehicle too.")
]
Component: TypeAlias = Annotated[
    int | None, option("N", "The autopilot's component number.", min=1, max=255)
]
OwnSystem: TypeAlias = Annotated[
    int | None, option("N", "The system number to speak as; without: 246.", min=1, max=255)
]
Radio: TypeAlias = Annotated[
    str | None, option("udp:HOST:PORT", "Tell radios the precoders of each slot, in JSON lines.")
]
Log: TypeAlias = Annotated[File, option("F.tlog", "Write a log of the exchange.")]
Wait: TypeAlias = Annotated[float, option("S", "How long to wait for the vehicle, s.", min=0.1)]
SigningKey: TypeAlias = Annotated[
    File, option("F", "File with the key for signed packets: 32 bytes, or in hex.")
]
Whose: TypeAlias = Annotated[
    str | None, option("NAME", "Whose mission it is: ardupilot or px4.", "--autopilot")
]
Aircraft: TypeAlias = Annotated[
    str | None, option("NAME", "What flies it: copter or plane.", "--type")
]
AsJson: TypeAlias = Annotated[bool, flag("--json", "Print one JSON object instead of the text.")]


@contextmanager
def exit_status() -> Iterator[None]:
    """Turn the errors of a command's work into a message and an exit status.

    2: `InputError`, unusable arguments or input; 1: any other `FaaoError`, the answer is no.
    """
    try:
        yield
    except FaaoError as error:
        note(str(error))
        raise typer.Exit(2 if isinstance(error, InputError) else 1) from None


def check_known(autopilot: str | None, kind: str | None) -> None:
    """Raise `InputError` for --autopilot or --type of which no vehicle is known."""
    from faao_mav.autopilot import autopilots, kinds

    for name, value, known in (("autopilot", autopilot, autopilots()), ("type", kind, kinds())):
        if value is not None and value not in known:
            raise InputError(f"--{name} {value}: expected {' or '.join(known)}")


def read_wind(given: str | None) -> "Vector | None":
    """Return the velocity of the air, m/s east and north, of --wind; raises `InputError`."""
    if given is None:
        return None
    from pydantic import TypeAdapter

    from faao_mav.plan import Wind
    from faao_mav.plan.keys import reference

    parts, keys = given.split(","), ("site.wind.speed", "site.wind.from")
    try:
        speed, start = map(float, parts)
        wind = TypeAdapter(Wind).validate_python({"speed": speed, "from": start})
    except ValueError:
        wanted = " and ".join(reference()[key].accepted for key in keys)
        raise InputError(f"--wind {given}: expected SPEED,FROM: {wanted}") from None
    return wind.velocity


def read_noted(mission_file: Path) -> "MissionFile":
    """Return what a mission file tells, and note what is odd about it."""
    from faao_mav.mission.formats import read_mission_file

    file = read_mission_file(mission_file)
    for line in file.warnings:
        note(line)
    return file


def check_page(report: Path | None, inputs: Mapping[str, Path | None]) -> None:
    """Raise `InputError` for a --report that cannot be written, or is one of the `inputs`."""
    if report is not None:
        check_ending(report, "--report", PAGES)
        check_writable(report)
    check_apart({"--report": report}, inputs)


def show(
    record: Callable[[], dict[str, Any]], lines: Callable[[], Iterable[str]], *, as_json: bool
) -> None:
    """Print what a command found: with --json its `record` as one object, else its `lines`."""
    text = json.dumps(record(), allow_nan=False) if as_json else "\n".join(lines())
    sys.stdout.write(f"{text}\n")  # typer.echo writes UTF-8 where ASCII is asked for


def note(message: str) -> None:
    """Say something that the result does not say, on standard error."""
    typer.echo(f"faao-mission: {message}", err=True)
