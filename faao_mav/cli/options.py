"""Options that the commands for vehicles share."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

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
    bool, typer.Option("--json", help="Print one JSON object instead of the summary.")
]
