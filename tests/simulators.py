"""Real autopilots in their simulators, on the loopback interface, for tests and benchmarks."""

import os
import shlex
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import SystemRandom
from typing import TypeAlias

from conftest import free_port

HOME = "-35.363262,149.165237,584"
"""Where the simulated vehicles stand: latitude and longitude in degrees, metres above the sea."""

PX4_STARTS = 4
"""How often PX4 is started at most: its simulator does not always come up on a busy machine."""

_MODELS = {"arducopter": ("+", "copter.parm"), "arduplane": ("plane", "plane.parm")}
"""ArduPilot's programs: the simulated airframe, and the file with its parameters."""

KINDS = (*_MODELS, "px4")

Running: TypeAlias = tuple[str, Callable[[], None]]
"""Where an autopilot is heard, and what reboots it."""

_RESPAWN = """#!/bin/sh
trap 'kill "$child"; exit' TERM
while :; do
    {program} "$@" &
    child=$!
    echo "$child" > {pid}
    wait "$child"
    [ $? -eq 137 ] || exit
done
"""
"""What PX4's runner runs for PX4: it starts it again whenever it is killed."""


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
    if kind != "px4" and not bare:
        parameters = autopilots / "ardupilot" / _MODELS[kind][1]
        options = ("--defaults", str(parameters), *options)
    start = _px4 if kind == "px4" else _ardupilot
    with start(autopilots, kind, where, options) as (connection, _):
        yield connection


def start_log(autopilots: Path, home: Path) -> None:
    """Have the PX4 that runs in `home` write its `.ulg` there, from now on.

    Its parameter SDLOG_MODE starts the logger at boot, to wake with each estimate: the logger then
    waits for the simulator, which waits for it. By the clock, 20 times a second, it waits for none.
    """
    (lock,) = home.glob("run/px4-sock-*")
    program, instance = autopilots / "px4" / "bin" / "px4-logger", lock.name.rsplit("-", 1)[-1]
    subprocess.run(
        [str(program), "--instance", instance, "start", "-f", "-r", "20"],
        cwd=home,
        env=os.environ | {"HOME": str(home)},
        capture_output=True,
        check=True,
    )


@contextmanager
def rebootable(autopilots: Path, kind: str, where: Path) -> Iterator[Running]:
    """Run an autopilot as `simulated` does, and yield what cuts its power too.

    It boots again at once, with what it has stored.
    """
    if kind == "px4":
        program, respawn, pid = autopilots / "px4/bin/px4", where / "respawn", where / "pid"
        quoted = {"program": shlex.quote(str(program)), "pid": shlex.quote(str(pid))}
        respawn.write_text(_RESPAWN.format(**quoted))
        respawn.chmod(0o700)
        with _px4(autopilots, kind, where, ("--binary", str(respawn))) as (connection, _):
            yield connection, lambda: os.kill(int(pid.read_text()), signal.SIGKILL)
    else:
        parameters = autopilots / "ardupilot" / _MODELS[kind][1]
        with _ardupilot(autopilots, kind, where, ("--defaults", str(parameters))) as running:
            yield running


@contextmanager
def _ardupilot(
    autopilots: Path, kind: str, where: Path, options: Sequence[str]
) -> Iterator[Running]:
    port = free_port()
    command = [str(autopilots / "ardupilot" / kind), "--model", _MODELS[kind][0], *options]
    command += ["--home", f"{HOME},0", "-I", str(_free_instance()), "--sysid", "1"]
    command += ["--serial0", f"udpclient:127.0.0.1:{port}"]

    def start(*wiping: str) -> subprocess.Popen[bytes]:
        quiet = subprocess.DEVNULL
        return subprocess.Popen([*command, *wiping], cwd=where, stdout=quiet, stderr=quiet)

    process = start("-w")

    def reboot() -> None:
        nonlocal process
        process.kill()
        process.wait()
        process = start()

    try:
        yield f"udpin:127.0.0.1:{port}", reboot
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
def _px4(autopilots: Path, kind: str, where: Path, options: Sequence[str]) -> Iterator[Running]:
    port, runner = free_port(), str(autopilots / "fly_px4.py")
    command = [sys.executable, runner, "--serve", f"--home={HOME}", "--gcs-port", str(port)]
    for _ in range(PX4_STARTS):
        process = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            if any(line.startswith("READY") for line in process.stdout):
                yield f"udpin:127.0.0.1:{port}", lambda: None
                return
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate()
    raise RuntimeError("PX4's simulator does not start")
