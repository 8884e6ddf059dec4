"""Who may use the page: only who has the token, and only from the page itself."""

import hmac
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, TypeAlias
from urllib.parse import parse_qs, urlencode, urlsplit

Scope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Application: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]

TILES = "https://tile.openstreetmap.org"
"""Where the background map comes from, if it is switched on."""

_POLICY = (
    "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; object-src 'none'; "
    f"img-src 'self' data: blob: {TILES}; frame-ancestors 'none'; form-action 'self'; "
    "base-uri 'self'"
)
"""The page's Content-Security-Policy: Vue compiles templates and NiceGUI's scripts are inline; no
request leaves for elsewhere but those for tiles."""


class Guard:
    """An ASGI application in front of another: it lets through what comes from its own page.

    A request needs the `token`, in the address once and then in a cookie; other users of the
    machine do not have it. It needs a Host among `hosts`, so that no other name leads here (DNS
    rebinding), and a request that may change something, or opens a websocket, no Origin but this
    host: a page from elsewhere cannot use the cookie.
    """

    def __init__(self, inner: Application, token: str, hosts: Iterable[str], port: int) -> None:
        self._inner, self._token = inner, token
        self._hosts = {f"{host}:{port}" for host in hosts}
        self._cookie = f"faao-app-{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or hand it on."""
        if scope["type"] not in ("http", "websocket"):  # start and end of the server
            await self._inner(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1")
                   for name, value in scope["headers"]}  # fmt: skip
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        given = query.pop("token", [""])[0]
        if not self._from_here(scope, headers):
            await _refuse(scope, send, "this address is not used from other pages")
        elif self._equal(self._cookie_of(headers)):
            await self._inner(scope, receive, _with_policy(send))
        elif scope["type"] == "http" and scope["method"] == "GET" and self._equal(given):
            where = (
                "/"
                + scope["path"].lstrip("/")
                + ("?" + urlencode(query, doseq=True) if query else "")
            )
            cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Lax"
            headers_back = [(b"location", where.encode()), (b"set-cookie", cookie.encode())]
            await send({"type": "http.response.start", "status": 303, "headers": headers_back})
            await send({"type": "http.response.body"})
        else:
            await _refuse(scope, send, "open the address that faao-mission app printed")

    def _from_here(self, scope: Scope, headers: dict[str, str]) -> bool:
        host, origin = headers.get("host", ""), headers.get("origin")
        if host not in self._hosts:
            return False
        if scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD"):
            return origin is not None and urlsplit(origin).netloc == host
        return origin is None or urlsplit(origin).netloc == host

    def _cookie_of(self, headers: dict[str, str]) -> str:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return ""
        return found.value if found is not None else ""

    def _equal(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())


async def _refuse(scope: Scope, send: Send, why: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    kind = [(b"content-type", b"text/plain; charset=utf-8")]
    await send({"type": "http.response.start", "status": 403, "headers": kind})
    await send({"type": "http.response.body", "body": f"{why}\n".encode()})


def _with_policy(send: Send) -> Send:
    async def sent(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            more = [
                (b"content-security-policy", _POLICY.encode()),
                (b"referrer-policy", b"strict-origin-when-cross-origin"),
                (b"x-content-type-options", b"nosniff"),
            ]
            message = {**message, "headers": [*message.get("headers", ()), *more]}
        await send(message)

    return sent
