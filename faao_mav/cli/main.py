"""`faao-mission`: which command an argument list is for."""

import difflib
import io
import os
import signal
import sys
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

import faao_mav.cli.shared as cli
from faao_mav.cli.link import link
from faao_mav.cli.missions import convert, validate
from faao_mav.cli.plan import plan
from faao_mav.cli.serving import app as page
from faao_mav.cli.serving import autopilot
from faao_mav.cli.study import study
from faao_mav.cli.vehicle import debrief, download, fly, upload
from faao_mav.errors import HangUp


class _CommandOrPlan(TyperGroup):
    """A first argument that names no command is a plan, or an option of the command that plans."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        own = {name for parameter in self.get_params(ctx) for name in parameter.opts}
        if args and args[0] not in self.commands and args[0] not in own:
            self._check_is_plan(ctx, args[0])
            args = [plan.__name__, *args]
        return super().parse_args(ctx, args)

    def _check_is_plan(self, ctx: Any, argument: str) -> None:
        """Take a bare word that is no file for a mistyped command."""
        path = Path(argument)
        if argument.startswith("-") or path.suffix or path.name != argument:
            return
        if os.path.lexists(path):
            return
        near = difflib.get_close_matches(argument, self.commands, n=1)
        hint = f"did you mean {near[0]}?" if near else f"commands: {', '.join(self.commands)}"
        ctx.fail(f"{argument}: no command and no file of this name; {hint}")


app = typer.Typer(
    cls=_CommandOrPlan,
    subcommand_metavar="PLAN.yaml | COMMAND ...",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_COMMANDS = (plan, validate, upload, download, fly, debrief, link, convert, autopilot, study, page)
for command in _COMMANDS:
    app.command(command.__name__)(cli.exit_status()(command))


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"faao-mission {version('faao-mav')}")
        raise typer.Exit


@app.callback()
def main(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version."
    ),
) -> None:
    """Plan radio-relay flights of UAVs, as MAVLink missions for ArduPilot and PX4.

    To plan, name a plan file, and the mission to write:

        faao-mission PLAN.yaml --out MISSION

    A first argument that names none of the commands is taken for a plan. Each command
    tells its options with --help.
    """


def _hang_up(*_: object) -> None:
    raise HangUp


def run() -> None:
    """Entry point of `faao-mission`.

    A character that standard output cannot show is shown as its code. Where nothing can be
    written there, the exit status is 2, or 1 where the reader has gone. SIGTERM interrupts as the
    keyboard does: a transfer is cancelled. So does SIGHUP, unless it is ignored, but a mission that
    is under way is left alone: the terminal has gone.
    """
    for name, handler in (("SIGTERM", signal.default_int_handler), ("SIGHUP", _hang_up)):
        number = getattr(signal, name, signal.SIGTERM)
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, handler)
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # small matrices: more threads wait and spin
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        app()
    except OSError as error:
        where = error.filename or "standard output"
        cli.note(f"{where}: cannot be used: {error.strerror or error}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what is buffered fails no second time
        sys.exit(2)
