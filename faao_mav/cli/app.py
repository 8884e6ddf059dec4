"""`faao-mission app`: the planner page."""

from pathlib import Path

import typer

from faao_mav.cli.shared import File, exit_status, flag, note, option

_EMPTY = """\
name: new relay
site:
  origin: {latitude: -35.363262, longitude: 149.165237, elevation: 584}
vehicle: {max_speed: 8, max_acceleration: 1.5}
flight: {start: [0, 350], end: [350, 0], altitude: 100, duration: 120, time_step: 0.5}
radio:
  base_station: {position: [0, 0], power_dbm: 10}
  relay: {power_dbm: 10, noise_dbm: -91}
  ground_user: {position: [300, 300], noise_dbm: -91}
  modulation: qpsk
"""
"""The plan that the page begins with where none is given."""


@exit_status()
def app(
    plan_file: Path | None = typer.Argument(
        None, metavar="[PLAN.yaml]", help="The plan to begin with."
    ),
    port: int = option(
        "N", "The port to serve at; 0: any that is free.", min=0, max=65535, default=0
    ),
    host: str = option(
        "ADDRESS",
        "The address to serve at; not loopback: others can reach it.",
        default="127.0.0.1",
    ),
    mbtiles: File = option("FILE", "A background map for the field: an MBTiles file of pictures."),
    no_browser: bool = flag("--no-browser", "Only print the address."),
) -> None:
    """Serve the planner page: drag stations, draw zones, see the flight.

    The address that is printed has a token in it: who does not have the token gets nothing. The
    file is written by Save alone. Nothing is fetched from elsewhere unless the background map is
    switched on; that of --mbtiles is served by this command too.
    """
    from faao_mav.app.document import Document
    from faao_mav.errors import check_extra

    def begin() -> Document:
        return Document(_EMPTY) if plan_file is None else Document.open(plan_file)

    begin()  # what is no plan is refused at once
    check_extra("app", "nicegui", "the planner page")
    from faao_mav.app.serve import TileFile, serve

    tiles = None if mbtiles is None else TileFile(mbtiles)
    serve(begin, host=host, port=port, browser=not no_browser, tiles=tiles, note=note)
