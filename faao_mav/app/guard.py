"""Who may use the page: only who has the token, and only from the page itself."""

import hmac
from collections.abc import Iterable
from urllib.parse import urlencode

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

TILES = "https://tile.openstreetmap.org"
"""Where the background map comes from, if it is switched on."""

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
