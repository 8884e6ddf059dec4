"""What the commands share: options, exit statuses, messages."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from faao_mav.errors import FaaoError, InputError

System: TypeAlias = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=255, help="The vehicle's system number.")
]
AllowArmed: TypeAlias = Annotated[
    bool, typer.Option("--allow-armed", help="Replace the mission of an armed vehicle too.")
]
Component: TypeAlias = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=255, help="The autopilot's component number.")
]
Log: TypeAlias = Annotated[
    Path | None, typer.Option(metavar="F.tlog", help="Write a log of the exchange.")
]
Wait: TypeAlias = Annotated[
    float, typer.Option(metavar="S", min=0.1, help="How long to wait for the vehicle, s.")
]
SigningKey: TypeAlias = Annotated[
    Path | None,
    typer.Option(metavar="F", help="File with the key for signed packets: 32 bytes, or in hex."),
]
AsJson: TypeAlias = Annotated[
    bool, typer.Option("--json", help="Print one JSON object instead of the text.")
]


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


def note(message: str) -> None:
    """Say something that the result does not say, on standard error."""
    typer.echo(f"faao-mission: {message}", err=True)
