"""The server of the page and its background map, and who may use it: who has the token alone."""

import asyncio
import contextlib
import hmac
import re
import secrets
import socket
import sqlite3
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Iterable, Iterator
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import uvicorn
from fastapi import FastAPI
from nicegui import ui
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from faao_mav.app.document import Document
from faao_mav.app.page import TILES, Page
from faao_mav.app.workers import Workers
from faao_mav.errors import FaaoError, InputError
from faao_mav.processes import apart_from_the_current_directory

_LOOPBACK = ("127.0.0.1", "localhost")  # the names under which this machine reaches itself
_TOKEN_BYTES = 24
_PATIENCE = 30.0  # s that a page which does not answer keeps its plan. Chosen for a busy machine
_GRACE = 2  # s that a page which is open has to take its leave when the server ends. Chosen
_DEEPEST = 22  # the greatest zoom of the map: a pixel is 4 cm at the equator. Chosen

_IMAGES = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "webp": "image/webp"}
"""What tiles of a `format` are, as browsers name it; others are not pictures."""

_OPEN_STREET_MAP: dict[str, Any] = {
    "url": f"{TILES}/{{z}}/{{x}}/{{y}}.png",
    "attribution": '&copy; <a href="https://openstreetmap.org/copyright">OpenStreetMap</a> '
    "contributors",
    "deepest": 19,
}
"""A background map: where its tiles are, who made it, and up to which zoom it has any."""

_HEADERS = {
    # Vue compiles templates and NiceGUI's scripts are inline; only tiles come from elsewhere
    "content-security-policy": (
        "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; object-src 'none'; "
        f"img-src 'self' data: blob: {TILES}; frame-ancestors 'none'; form-action 'self'; "
        "base-uri 'self'"
    ),
    "referrer-policy": "strict-origin-when-cross-origin",
    "x-content-type-options": "nosniff",
}
"""What the browser is told about the page."""


class Guard:
    """An ASGI application in front of another: it lets through what comes from its own page.

    A request needs the `token`, in the address once and then in a cookie; other users of the
    machine do not have it. It needs a Host among `hosts`, so that no other name leads here (DNS
    rebinding), and a request that may change something, or opens a websocket, the Origin of this
    host: a page from elsewhere cannot use the cookie.
    """

    def __init__(self, inner: ASGIApp, token: str, hosts: Iterable[str], port: int) -> None:
        self._inner, self._token = inner, token
        self._hosts = {f"{host}:{port}" for host in hosts}
        self._cookie = f"faao-app-{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or hand it on."""
        if scope["type"] not in ("http", "websocket"):  # start and end of the server
            await self._inner(scope, receive, send)
            return
        asked = HTTPConnection(scope)
        query = dict(asked.query_params)
        given = query.pop("token", "")
        answer: Response
        if not self._from_here(asked):
            answer = PlainTextResponse("this address is not used from other pages\n", 403)
        elif scope["type"] == "http" and scope["method"] == "GET" and self._equal(given):
            path = "/" + scope["path"].lstrip("/")
            answer = RedirectResponse(f"{path}?{urlencode(query)}" if query else path, 303)
            answer.set_cookie(self._cookie, self._token, httponly=True, samesite="lax")
        elif self._equal(asked.cookies.get(self._cookie, "")):
            await self._inner(scope, receive, _with_headers(send))
            return
        else:
            answer = PlainTextResponse("open the address that faao-mission app printed\n", 403)
        refusal = answer if scope["type"] == "http" else WebSocketClose(1008)
        await refusal(scope, receive, send)

    def _from_here(self, asked: HTTPConnection) -> bool:
        host, origin = asked.headers.get("host", ""), asked.headers.get("origin")
        reads = asked.scope["type"] == "http" and asked.scope["method"] in ("GET", "HEAD")
        return host in self._hosts and (reads if origin is None else origin == f"http://{host}")

    def _equal(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())


def _with_headers(send: Send) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(_HEADERS)
        await send(message)

    return sent


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
        if (kind := str(told.get("format"))) not in _IMAGES:
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
        address = f"{self._path.resolve().as_uri()}?mode=ro"
        with contextlib.closing(sqlite3.connect(address, uri=True)) as data:
            return data.execute(asked, values).fetchall()


@apart_from_the_current_directory()
def serve(
    plan: Path | None,
    *,
    host: str,
    port: int,
    browser: bool,
    tiles: TileFile | None,
    note: Callable[[str], None],
) -> None:
    """Serve the page until interrupted; each window begins with a document of its own of `plan`.

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
            background = tiles.background if tiles else _OPEN_STREET_MAP
            Page(Document.open(plan), workers, background).build()
        except FaaoError as error:  # the file is another one by now
            ui.label(str(error))

    inner = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    if tiles is not None:

        @inner.get("/tiles/{zoom}/{x}/{y}")
        def tile(zoom: int, x: int, y: int) -> Response:
            found = tiles.tile(zoom, x, y)
            return Response(found, 204 if found is None else 200, media_type=tiles.media_type)

    ui.run_with(
        inner,
        dark=None,
        show_welcome_message=False,
        binding_refresh_interval=None,  # nothing is bound
        reconnect_timeout=_PATIENCE,
    )
    here = f"[{host}]" if ":" in host else host
    names = _LOOPBACK if host in _LOOPBACK else (here, *_LOOPBACK)
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
    """Return a socket that listens: who comes before the server has begun waits for it."""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        both = family == socket.AF_INET6  # an address of all: of IPv4 too
        return socket.create_server(address, family=family, dualstack_ipv6=both)
    except OSError as error:
        why, *_ = (error.strerror or str(error)).split(" (while ")  # Python adds the address
        raise InputError(f"--host {host} --port {port}: {why}") from None


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
