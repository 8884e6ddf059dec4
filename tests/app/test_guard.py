"""Who may use the page: without the token, by another name or from another page nobody."""

import asyncio
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("starlette", reason="the extra app is not installed")
from faao_mav.app.guard import Guard

TOKEN, HOST = "s3cret", "127.0.0.1:8000"
COOKIE = f"faao-app-8000={TOKEN}"


async def behind(scope: Any, receive: Any, send: Any) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
    else:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"the page"})


def ask(
    path: str = "/",
    *,
    kind: str = "http",
    method: str = "GET",
    query: str | bytes = "",
    **headers: str | bytes,
) -> list[dict[str, Any]]:
    scope = {
        "type": kind,
        "method": method,
        "path": path,
        "query_string": _bytes(query),
        "headers": [(k.encode(), _bytes(v)) for k, v in {"host": HOST, **headers}.items()],
    }
    sent: list[dict[str, Any]] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        raise AssertionError

    guard = Guard(behind, TOKEN, ("127.0.0.1", "localhost"), 8000)
    asyncio.run(guard(scope, receive, send))
    return sent


def _bytes(value: str | bytes) -> bytes:
    return value.encode() if isinstance(value, str) else value


def status(*answer: Any, **asked: Any) -> int:
    return int(ask(*answer, **asked)[0]["status"])


def test_the_token_in_the_address_becomes_a_cookie_and_leaves_the_address() -> None:
    start, _ = ask("//elsewhere.org", query=f"token={TOKEN}&a=b")
    assert status(query=f"token={TOKEN}", cookie=COOKIE) == 303  # a second window
    headers = dict(start["headers"])
    assert start["status"] == 303
    assert headers[b"location"] == b"/elsewhere.org?a=b"
    cookie = {*headers[b"set-cookie"].decode().split("; ")}
    assert cookie == {COOKIE, "Path=/", "HttpOnly", "SameSite=lax"}


def test_another_user_of_the_machine_gets_nothing() -> None:
    cookies = ("", "faao-app-8000=x", "faao-app-1=s3cret", "\x7f;;=")
    for query, cookie in [*(("", each) for each in cookies), ("token=", ""), ("token=s3cre", "")]:
        for path in ("/", "/_nicegui/x.js"):
            answer = ask(path, query=query, cookie=cookie)
            assert answer[0]["status"] == 403
            assert b"the page" not in answer[1]["body"]
        (closed,) = ask(kind="websocket", origin=f"http://{HOST}", cookie=cookie)
        assert closed["type"] == "websocket.close"


def test_the_page_itself_is_served_with_its_policy() -> None:
    start, body = ask(cookie=f"other=1; {COOKIE}")
    assert (start["status"], body["body"]) == (200, b"the page")
    policy = dict(start["headers"])[b"content-security-policy"].decode()
    assert "default-src 'self'" in policy
    assert status(method="POST", origin=f"http://{HOST}", cookie=COOKIE) == 200
    here = {"origin": "http://localhost:8000", "host": "localhost:8000"}
    assert ask(kind="websocket", **here, cookie=COOKIE)[0]["type"] == "websocket.accept"


def test_a_page_from_elsewhere_can_neither_post_nor_open_a_websocket() -> None:
    odd = ["http://evil.org", "null", "http://127.0.0.1:8001", f"http://{HOST}.evil.org", HOST, "",
           "http://[", "http://[::1", f"http://u@{HOST}", f"//{HOST}", f"x://{HOST}"]  # fmt: skip
    for origin in odd:
        assert status(method="POST", origin=origin, cookie=COOKIE) == 403
        assert status(origin=origin, cookie=COOKIE) == 403
        (closed,) = ask(kind="websocket", origin=origin, cookie=COOKIE)
        assert (closed["type"], closed["code"]) == ("websocket.close", 1008)
    assert status(method="POST", cookie=COOKIE) == 403  # without an origin
    assert ask(kind="websocket", cookie=COOKIE)[0]["type"] == "websocket.close"
    assert status(host="evil.org:8000", cookie=COOKIE) == 403  # by another name
    assert status(host="127.0.0.1:1", query=f"token={TOKEN}") == 403


ODD = st.one_of(
    st.binary(max_size=60),
    st.text(alphabet="[]@:/?#%;=,&\\\"' \t\r\n\0\x7f", max_size=30),
    st.text(max_size=30),
    st.sampled_from([HOST, f"http://{HOST}", f"token={TOKEN[:-1]}", COOKIE[:-1], "http://["]),
)


@given(
    path=st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=20),
    kind=st.sampled_from(["http", "websocket"]),
    method=st.sampled_from(["GET", "HEAD", "POST", "PUT", "OPTIONS", "X"]),
    query=ODD,
    headers=st.dictionaries(st.sampled_from(["host", "origin", "cookie", "x"]), ODD),
)
def test_whatever_is_sent_without_the_token_is_refused_cleanly(
    path: str, kind: str, method: str, query: str | bytes, headers: dict[str, str | bytes]
) -> None:
    answer = ask(path, kind=kind, method=method, query=query, **headers)
    if kind == "websocket":
        assert answer == [{"type": "websocket.close", "code": 1008, "reason": ""}]
    else:
        assert answer[0]["status"] == 403
    for other in ("http", "websocket"):  # nor is there a traceback for who has it
        ask(path, kind=other, method=method, query=query, **{**headers, "cookie": COOKIE})
    ask(path, query=f"token={TOKEN}&".encode() + _bytes(query))
