"""`faao-mission app` and `autopilot`: the planner page and the mock autopilot, until Ctrl-C."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

import faao_mav.cli.shared as cli
from faao_mav.errors import InputError, counted

if TYPE_CHECKING:
    from collections.abc import Callable

    from faao_mav.sim import MockAutopilot
    from faao_mav.sim.faults import Faults

_HIGHEST = 100_000.0
"""The greatest altitude of a home, m: chosen, where space begins; the wire carries millimetres."""


def app(
    plan_file: Path | None = typer.Argument(
        None, metavar="[PLAN.yaml]", help="The plan to begin with."
    ),
    port: int = cli.option(
        "N", "The port to serve at; 0: any that is free.", min=0, max=65535, default=0
    ),
    host: str = cli.option(
        "ADDRESS",
        "The address to serve at; not loopback: others can reach it.",
        default="127.0.0.1",
    ),
    mbtiles: cli.File = cli.option(
        "FILE", "A background map for the field: an MBTiles file of pictures."
    ),
    no_browser: bool = cli.flag("--no-browser", "Only print the address."),
) -> None:
    """Serve the planner page: drag stations, draw zones, see the flight.

    The address that is printed has a token in it: who does not have the token gets nothing. The
    file is written by Save alone. Nothing is fetched from elsewhere unless the background map is
    switched on; that of --mbtiles is served by this command too.
    """
    from faao_mav.app.document import Document
    from faao_mav.errors import check_extra

    Document.open(plan_file)  # what is no plan is refused at once
    check_extra("app", "nicegui", "the planner page")
    from faao_mav.app.serve import TileFile, serve

    tiles = None if mbtiles is None else TileFile(mbtiles)
    serve(plan_file, host=host, port=port, browser=not no_browser, tiles=tiles, note=cli.note)


def _faults(
    drop: float = cli.option("P", "Lose packets, both ways.", min=0, max=1, default=0.0),
    duplicate: float = cli.option("P", "Repeat packets.", min=0, max=1, default=0.0),
    corrupt: float = cli.option("P", "Damage packets.", min=0, max=1, default=0.0),
    delay: float = cli.option(
        "S", "Delay every other packet by up to S seconds.", min=0, default=0.0
    ),
    seed: int = cli.option("N", "Of what the link does.", default=0),
) -> "Faults":
    from faao_mav.sim.faults import Faults

    odd = 0.5 if delay else 0.0
    return Faults(drop, duplicate, corrupt, reordering=odd, delay=delay, latency=0.0, seed=seed)


@cli.with_options(faults=_faults)
def autopilot(
    listen: str = cli.option(
        "CONNECTION",
        "Where ground stations find it: udpin:HOST:PORT, tcpin:HOST:PORT, or "
        "udpout:HOST:PORT to call one.",
        default="udpin:127.0.0.1:14550",
    ),
    kind: Literal["ardupilot", "px4"] = typer.Option(
        help="Whose manners it has.", default="ardupilot"
    ),
    aircraft: str = cli.option(
        "NAME", "What it flies: a copter, or with ardupilot a plane.", "--type", default="copter"
    ),
    system: int = cli.option("N", "Its number.", min=1, max=255, default=1),
    home: str = cli.option(
        "LAT,LON,ALT", "Where it stands: degrees, m AMSL.", default="-35.363262,149.165237,584"
    ),
    parameters: cli.File = cli.option(
        "FILE", "Its parameters: it flies by them; without: defaults."
    ),
    wind: str | None = cli.option("SPEED,FROM", "The wind that it flies in, m/s and degrees."),
    speedup: float = cli.option("X", "Fly X times as fast as predicted.", min=0.01, default=1.0),
    boot: float = cli.option("S", "Boot for S seconds.", min=0, default=0.0),
    *,
    faults: "Faults",
    signing_key: cli.File = cli.SIGNING_KEY,
) -> None:
    """Run a mock autopilot: it takes, gives and flies missions like ArduPilot or PX4.

    In GUIDED and Offboard it follows setpoints.

    It ends with Ctrl-C. Exit status: 0 ended; 1 the other end of tcp: is not there; 2 unusable
    arguments, or it cannot listen there.
    """
    from faao_mav.autopilot import Vehicle
    from faao_mav.mission.formats.parameter_file import read_parameters
    from faao_mav.mission.item import Home
    from faao_mav.sim import MockAutopilot, behaviour_of
    from faao_mav.sim.faults import serve
    from faao_mav.wire.protocol import Address
    from faao_mav.wire.signing import read_signing
    from faao_mav.wire.transport import open_transport

    wanted = f"--home {home}: expected LAT,LON,ALT, as in 47.397742,8.545594,488"
    latitude, longitude, altitude = cli.read_numbers(home, 3, wanted)
    if abs(altitude) > _HIGHEST:
        raise InputError(f"--home {home}: expected an altitude of at most {_HIGHEST:g} m")
    values = {} if parameters is None else read_parameters(parameters)
    cli.check_known(None, aircraft)
    behaviour = behaviour_of(kind)
    vehicle = Vehicle(behaviour.family.key, aircraft, values, str(parameters or "parameters"))
    vehicle.flight_model()  # useless parameters are refused here, not in flight
    mock = MockAutopilot(
        behaviour,
        aircraft=aircraft,
        address=Address(system, 1),
        home=Home(latitude, longitude, altitude),
        wind=cli.read_wind(wind) or (0.0, 0.0),
        parameters=values,
        speedup=speedup,
        boot=boot,
    )
    key = None if signing_key is None else read_signing(signing_key).key
    transport = open_transport(listen)
    typer.echo(f"{kind}, system {system}, at {listen}; Ctrl-C ends")
    try:
        serve(mock, transport, faults=faults, key=key, observe=_diary())
    except KeyboardInterrupt:
        typer.echo("ended")


def _diary() -> "Callable[[MockAutopilot], None]":
    """Return what prints, whenever it is called, what has changed on a mock autopilot."""
    from faao_mav.wire.protocol import MissionType

    told: dict[str, object] = {}

    def observe(mock: "MockAutopilot") -> None:
        for part in MissionType:
            rows = mock.lists.items(part)
            if rows != told.setdefault(part.title, rows):
                typer.echo(f"{part.title}: {counted(len(rows), 'row')}")
            told[part.title] = rows
        if mock.armed != told.setdefault("armed", mock.armed):
            typer.echo("armed" if mock.armed else "disarmed")
        told["armed"] = mock.armed

    return observe
