"""What a command's end means: exit status and one message on standard error."""

from collections.abc import Iterator
from contextlib import contextmanager

import typer

from faao_mav.errors import FaaoError, InputError


@contextmanager
def exit_status() -> Iterator[None]:
    """Turn the errors of a command's work into a message and an exit status.

    2: `InputError`, unusable arguments or input; 1: any other `FaaoError`, the answer is no.
    """
    try:
        yield
    except InputError as error:
        _fail(error, 2)
    except FaaoError as error:
        _fail(error, 1)


def note(message: str) -> None:
    """Say something that the result does not say, on standard error."""
    typer.echo(f"faao-mission: {message}", err=True)


def _fail(error: FaaoError, status: int) -> None:
    note(str(error))
    raise typer.Exit(status)
