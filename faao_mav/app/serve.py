"""The server of the page and its background map: a port, and the address with the token in it."""

import asyncio
import contextlib
import re
import secrets
import socket
import sqlite3
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path
from typing import Any

import uvicorn
from fastapi import FastAPI, Response
from nicegui import ui

from faao_mav.app.document import Document
from faao_mav.app.guard import TILES, Guard
from faao_mav.app.page import Page
from faao_mav.app.workers import Workers
from faao_mav.errors import FaaoError, InputError
from faao_mav.processes import apart_from_the_current_directory

LOOPBACK = ("127.0.0.1", "localhost")
"""The names under which this machine reaches itself."""

_TOKEN_BYTES = 24

_PATIENCE = 30.0
"""Seconds that a page which does not answer keeps its plan: then it is made anew. Chosen: a busy
machine answers within that."""

_GRACE = 2
"""Seconds that a page which is open has to take its leave when the server ends. Chosen."""


_IMAGES = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "webp": "image/webp"}
"""What tiles of a `format` are, as browsers name it; others are not pictures."""

_DEEPEST = 22
"""The greatest zoom of the map, at which a pixel is 4 cm at the equator. Chosen."""


OPEN_STREET_MAP: dict[str, Any] = {
    "url": f"{TILES}/{{z}}/{{x}}/{{y}}.png",
    "attribution": '&copy; <a href="https://openstreetmap.org/copyright">OpenStreetMap</a> '
    "contributors",
    "deepest": 19,
}
"""A background map: where its tiles are, who made it, and up to which zoom it has any."""


class TileFile:
    """The pictures of an MBTiles file (version 1.3 of its specification): a database of SQLite.

    `path` is that of the table "tiles", whose rows count from the south; "metadata" tells what
    they are. Raises `InputError` for a file that cannot be read, or whose tiles are no pictures.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        if not path.is_file():
            raise InputError(f"--mbtiles {path}: there is no such file")
        try:
            told = dict(self._rows("SELECT name, value FROM metadata"))
            ((most,),) = self._rows("SELECT MAX(zoom_level) FROM tiles")
        except (sqlite3.Error, TypeError, ValueError) as error:
            raise InputError(f"--mbtiles {path}: not an MBTiles file: {error}") from None
        kind = str(told.get("format"))
        if kind not in _IMAGES:
            known = ", ".join(_IMAGES)
            raise InputError(f"--mbtiles {path}: tiles of format {kind}; expected one of {known}")
        if not isinstance(most, int) or most < 0:
            raise InputError(f"--mbtiles {path}: there are no tiles in it")
        self.media_type = _IMAGES[kind]
        self.background: dict[str, Any] = {
            "url": "tiles/{z}/{x}/{y}",
            "attribution": escape(re.sub("<[^>]*>", "", str(told.get("attribution", "")))),
            "deepest": min(most, _DEEPEST),
        }

    def tile(self, zoom: int, x: int, y: int) -> bytes | None:
        """Return the picture in column `x` and row `y`, from the north, at `zoom`; None: none."""
        if not 0 <= zoom <= _DEEPEST or not 0 <= x < 1 << zoom or not 0 <= y < 1 << zoom:
            return None
        place = (zoom, x, (1 << zoom) - 1 - y)
        asked = "SELECT tile_data FROM tiles WHERE zoom_level=? AND tile_column=? AND tile_row=?"
        try:
            found = self._rows(asked, place)
        except sqlite3.Error:  # the file is damaged there, or gone
            return None
        return found[0][0] if found and isinstance(found[0][0], bytes) else None

    def _rows(self, asked: str, values: tuple[int, ...] = ()) -> list[Any]:
        # a connection each: they are asked for by several threads
        with contextlib.closing(
            sqlite3.connect(f"{self._path.resolve().as_uri()}?mode=ro", uri=True)
        ) as data:
            return data.execute(asked, values).fetchall()


@apart_from_the_current_directory()
def serve(
    begin: Callable[[], Document],
    *,
    host: str,
    port: int,
    browser: bool,
    tiles: TileFile | None,
    note: Callable[[str], None],
) -> None:
    """Serve the page until interrupted; each window `begin`s with a document of its own.

    `port` 0 stands for any that is free. `tiles` are served as the background map in the stead of
    OpenStreetMap's. `note` is told the address, with the token in it; with
    `browser` that is opened. Raises `InputError` where the port cannot be had.
    """
    listening = _bound(host, port)
    port = listening.getsockname()[1]
    token, workers = secrets.token_urlsafe(_TOKEN_BYTES), Workers()

    @ui.page("/", title="faao-mission")
    def page() -> None:
        try:
            Page(begin(), workers, tiles.background if tiles else OPEN_STREET_MAP).build()
        except FaaoError as error:  # the file is another one by now
            ui.label(str(error))

    inner = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    if tiles is not None:

        @inner.get("/tiles/{zoom}/{x}/{y}")
        def tile(zoom: int, x: int, y: int) -> Response:
            found = tiles.tile(zoom, x, y)
            if found is None:
                return Response(status_code=204)
            return Response(found, media_type=tiles.media_type)

    ui.run_with(
        inner,
        dark=None,
        show_welcome_message=False,
        binding_refresh_interval=None,  # nothing is bound
        reconnect_timeout=_PATIENCE,
    )
    here = f"[{host}]" if ":" in host else host
    names = LOOPBACK if host in LOOPBACK else (here, *LOOPBACK)
    config = uvicorn.Config(
        Guard(inner, token, names, port),
        log_level="warning",
        server_header=False,
        lifespan="on",
        timeout_graceful_shutdown=_GRACE,
    )
    address = f"http://{here}:{port}/?token={token}"
    note(f"the page is at {address}")
    try:
        with _opened(address) if browser else contextlib.nullcontext():
            asyncio.run(uvicorn.Server(config).serve(sockets=[listening]))
    except KeyboardInterrupt:
        note("ended")
    finally:
        workers.stop()


def _bound(host: str, port: int) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listening = socket.socket(family, kind)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen()  # who comes before the server has begun waits for it
    except OSError as error:
        raise InputError(f"--host {host} --port {port}: {error.strerror or error}") from None
    return listening


@contextlib.contextmanager
def _opened(address: str) -> Iterator[None]:
    """Open `address` in the browser by way of a file that its user alone can read.

    The arguments of a process are seen by every user of the machine, and so would be the token.
    """
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "open.html"
        page.touch(mode=0o600)
        page.write_text(f'<meta http-equiv="refresh" content="0;url={escape(address)}">')
        # a browser of the terminal ends when its user does, who wants to be served meanwhile
        threading.Thread(target=webbrowser.open, args=[page.as_uri()], daemon=True).start()
        yield
