"""Real autopilots in their simulators, on the loopback interface, for tests and benchmarks."""

import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import SystemRandom

from conftest import free_port

HOME = "-35.363262,149.165237,584"
"""Where the simulated vehicles stand: latitude and longitude in degrees, metres above the sea."""

PX4_STARTS = 4
"""How often PX4 is started at most: its simulator does not always come up on a busy machine."""

_MODELS = {"arducopter": ("+", "copter.parm"), "arduplane": ("plane", "plane.parm")}
"""ArduPilot's programs: the simulated airframe, and the file with its parameters."""

KINDS = (*_MODELS, "px4")


def usable(named: Path, where: Path) -> Path:
    """Return `named`, or a copy below `where` if copying has spoiled PX4's commands in it.

    They are links to one program; some ways of copying leave files that hold the link's target.
    """
    commands = [path for path in named.glob("px4/bin/px4-*") if path.name != "px4-alias.sh"]
    if all(path.is_symlink() for path in commands):
        return named
    usable = where / named.name
    shutil.copytree(named, usable, symlinks=True, ignore=shutil.ignore_patterns("flights"))
    for command in commands:
        link = usable / "px4" / "bin" / command.name
        target = link.read_text()
        link.unlink()
        link.symlink_to(target)
    return usable


@contextmanager
def simulated(
    autopilots: Path, kind: str, where: Path, *options: str, bare: bool = False
) -> Iterator[str]:
    """Run an autopilot and yield the connection string at which it is heard; it boots meanwhile.

    `autopilots` is the folder with all of them, `kind` one of `KINDS`, `where` an empty folder for
    what ArduPilot stores. `options` go to ArduPilot's program or PX4's runner. A `bare` ArduPilot
    has its program's own defaults, with which it does not fly, instead of its simulator's.
    """
    if kind == "px4":
        with _px4(autopilots / "fly_px4.py", options) as port:
            yield f"udpin:127.0.0.1:{port}"
    else:
        model, parameters = _MODELS[kind]
        if not bare:
            options = ("--defaults", str(autopilots / "ardupilot" / parameters), *options)
        program = autopilots / "ardupilot" / kind
        with _ardupilot(program, where, ("--model", model, *options)) as port:
            yield f"udpin:127.0.0.1:{port}"


@contextmanager
def _ardupilot(program: Path, where: Path, options: Sequence[str]) -> Iterator[int]:
    port = free_port()
    command = [str(program), "--home", f"{HOME},0", "-I", str(_free_instance()), "--sysid", "1"]
    command += ["--serial0", f"udpclient:127.0.0.1:{port}", "-w", *options]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, cwd=where, stdout=quiet, stderr=quiet)
    try:
        yield port
    finally:
        process.kill()
        process.wait()


def _free_instance() -> int:
    """Return an instance of ArduPilot whose first TCP port nobody listens at.

    Where the search begins is drawn, so that two that are started at once do not meet.
    """
    begin = SystemRandom().randrange(50)
    for instance in [40 + (begin + k) % 50 for k in range(50)]:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", 5760 + 10 * instance)):
                return instance
    raise RuntimeError("ArduPilot's ports are all taken")


@contextmanager
def _px4(runner: Path, options: Sequence[str]) -> Iterator[int]:
    port = free_port()
    command = [sys.executable, str(runner), "--serve", f"--home={HOME}", "--gcs-port", str(port)]
    for _ in range(PX4_STARTS):
        process = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            if any(line.startswith("READY") for line in process.stdout):
                yield port
                return
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate()
    raise RuntimeError("PX4's simulator does not start")
