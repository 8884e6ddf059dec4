"""The server of the page: a port on loopback, and the address with the token in it."""

import asyncio
import contextlib
import secrets
import socket
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path

import uvicorn
from fastapi import FastAPI, Response
from nicegui import ui

from faao_mav.app.document import Document
from faao_mav.app.guard import Guard
from faao_mav.app.page import Page
from faao_mav.app.tiles import OPEN_STREET_MAP, TileFile
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
