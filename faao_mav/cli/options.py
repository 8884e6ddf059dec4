"""Options and endings that the commands for vehicles share."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from faao_mav.errors import FaaoError, InputError

System: TypeAlias = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=255, help="The vehicle's system number.")
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
    bool, typer.Option("--json", help="Print one JSON object instead of the summary.")
]


@contextmanager
def reported() -> Iterator[None]:
    """Turn errors into a message and an exit status: 2 for unusable input, 1 for the rest."""
    try:
        yield
    except FaaoError as error:
        typer.echo(f"faao-mission: {error}", err=True)
        raise typer.Exit(2 if isinstance(error, InputError) else 1) from None
