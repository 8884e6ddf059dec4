"""What the commands share: options, exit statuses, messages, progress."""

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import typer

from faao_mav.errors import FaaoError, InputError
from faao_mav.files import FIGURES, PAGES, check_apart, check_ending, check_writable

if TYPE_CHECKING:
    from faao_mav.mission.formats import MissionFile, PlanTarget, Rendered
    from faao_mav.mission.item import Mission
    from faao_mav.optimizer.solution import Observer, Progress, Solution
    from faao_mav.plan import Vector
    from faao_mav.wire.link import Observe


def option(value: str, text: str, *names: str, default: Any = None, **limits: Any) -> Any:
    """Return an option: what its value is called in the help, and what the option does."""
    return typer.Option(default, *names, metavar=value, help=text, **limits)


def flag(name: str, text: str) -> Any:
    """Return an option without a value: its name, and what it does."""
    return typer.Option(False, name, help=text)


VEHICLE = "The vehicle: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or DEVICE,BAUD."
"""The help of an option for a vehicle's connection."""

File: TypeAlias = Path | None

SYSTEM = option("N", "The vehicle's system number.", min=1, max=255)
ALLOW_ARMED = flag("--allow-armed", "Replace the mission of an armed vehicle too.")
SIGNING_KEY = option("F", "File with the key for signed packets: 32 bytes, or in hex.")
AUTOPILOT = option("NAME", "Whose mission it is: ardupilot or px4.", "--autopilot")
PLAN_FILE = option(
    "PLAN.yaml", "The plan: its vehicle, its limits, and the link that it is to deliver.", "--plan"
)
SOLUTION_FILE = option(
    "RESULT.npz",
    "Instead of --plan: what --save wrote, with the plan in it, already solved.",
    "--solution",
)
AS_JSON = flag("--json", "Print one JSON object instead of the text.")


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


def with_options(**groups: Callable[..., Any]) -> Callable[..., Callable[..., None]]:
    """Give a command more options, and each of `groups` made of its own as one argument.

    They are the parameters of a group, which is a function, or the fields of one, a dataclass, and
    stand in the help where the command takes the group.
    """
    theirs = {name: signature(group).parameters for name, group in groups.items()}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def run(**given: Any) -> None:
            for name, options in theirs.items():
                given[name] = groups[name](**{option: given.pop(option) for option in options})
            command(**given)

        parameters = []
        for each in signature(command).parameters.values():
            options = theirs.get(each.name, {each.name: each}).values()
            parameters += [option.replace(kind=each.kind) for option in options]
        vars(run)["__signature__"] = signature(command).replace(parameters=parameters)
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return decorate


def _link(
    system: int | None = SYSTEM,
    component: int | None = option("N", "The autopilot's component number.", min=1, max=255),
    own_system: int | None = option(
        "N", "The system number to speak as; without: 246.", min=1, max=255
    ),
    log: File = option("F.tlog", "Write a log of the exchange, in place of an older one."),
    wait: float = option(
        "S", "How long to wait for the vehicle, s.", "--timeout", min=0.1, default=10.0
    ),
    signing_key: File = SIGNING_KEY,
) -> dict[str, Any]:
    return locals() | {"note": note}


with_link = with_options(link=_link)
"""Gives a command the options of a link to a vehicle: `LinkOptions` whose `note` prints."""


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

    keys = ("site.wind.speed", "site.wind.from")
    wanted = " and ".join(reference()[key].accepted for key in keys)
    wanted = f"--wind {given}: expected SPEED,FROM: {wanted}"
    speed, start = read_numbers(given, 2, wanted)
    try:
        return TypeAdapter(Wind).validate_python({"speed": speed, "from": start}).velocity
    except ValueError:
        raise InputError(wanted) from None


def read_numbers(given: str, count: int, wanted: str, between: str = ",") -> tuple[float, ...]:
    """Return `count` finite numbers; raises `InputError` with what is `wanted` for others."""
    try:
        numbers = tuple(map(float, given.split(between)))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise InputError(wanted)
    return numbers


def read_noted(mission_file: Path) -> "MissionFile":
    """Return what a mission file tells, and note what is odd about it."""
    from faao_mav.mission.formats import read_mission_file

    file = read_mission_file(mission_file)
    for line in file.warnings:
        note(line)
    return file


def write_noted(mission: "Mission", out: Path, target: "PlanTarget | None") -> "Rendered":
    """Write a mission and return its files, and note what their format cannot hold."""
    from faao_mav.mission.formats import write_mission

    written = write_mission(mission, out, target)
    for line in written.lost:
        note(f"{out}: {line}")
    return written


def check_outputs(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None]) -> None:
    """Raise `InputError` for an output that cannot be written, or is another file of the command.

    Both are named as the user names them, an option or an argument; None stands for no file.
    """
    endings = {"--report": PAGES, "--figure": FIGURES, "--save": (".npz",)}
    for name, path in outputs.items():
        if path is not None:
            check_ending(path, name, endings.get(name))
            check_writable(path)
    check_apart(outputs, inputs)


def plain(record: object, **options: Any) -> Any:
    """Return what a `record` of dataclasses, files and numbers is in JSON, which has no NaN."""
    from pydantic_core import to_jsonable_python

    return to_jsonable_python(record, inf_nan_mode="null", **options)


def show(
    record: Callable[[], object],
    lines: Callable[[], Iterable[str]],
    *,
    as_json: bool,
    good: bool = True,
) -> None:
    """Print what a command found: with --json its `record` as one object, else its `lines`.

    What is not `good` ends the command with the exit status 1.
    """
    text = json.dumps(plain(record())) if as_json else "\n".join(lines())
    sys.stdout.write(f"{text}\n")  # typer.echo writes UTF-8 where ASCII is asked for
    if not good:
        raise typer.Exit(1)


def note(message: str) -> None:
    """Say something that the result does not say, on standard error."""
    typer.echo(f"faao-mission: {message}", err=True)


def planned(plan_file: Path | None, solution_file: Path | None) -> "Solution | None":
    """Return the solution saved, or that of the plan; None without either.

    Raises `InputError` where both are given.
    """
    if plan_file is not None and solution_file is not None:
        raise InputError("--plan and --solution: give one; the solution has its plan in it")
    if solution_file is not None:
        from faao_mav.optimizer.solution import load_solution

        return load_solution(solution_file)
    if plan_file is None:
        return None
    from faao_mav.optimizer.optimize import optimize
    from faao_mav.plan import read_plan

    plan = read_plan(plan_file)
    with optimizer_progress() as observe:
        return optimize(plan, observe=observe)


@contextmanager
def progress(*, quiet: bool = False) -> "Iterator[Observe]":
    """Give what draws a line on a terminal: what is done, how much of it, of how much (0: open).

    It is on standard error while there is work, unless that is to be `quiet`.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich import progress
    from rich.console import Console

    columns = ("{task.description}", progress.BarColumn(), progress.TimeElapsedColumn())
    with progress.Progress(*columns, console=Console(stderr=True), transient=True) as line:
        task = line.add_task("starting", total=None)
        yield lambda what, done, total: line.update(
            task, description=f"{what}, {done} of {total}" if total else what,
            completed=done, total=total or None,
        )  # fmt: skip


@contextmanager
def optimizer_progress(*, quiet: bool = False) -> "Iterator[Observer]":
    """Give an observer of the work on a plan."""
    with progress(quiet=quiet) as draw:

        def observe(now: "Progress") -> None:
            best = f", {now.best_rate:.4f} bit/s/Hz" if now.best_rate else ""
            steps = f"iteration {now.iteration} of at most {now.max_iterations}"
            draw(f"{now.stage}{best}, {steps}", 0, 0)

        yield observe
