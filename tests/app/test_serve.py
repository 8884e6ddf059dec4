"""Who may use the page, without the token nobody; and the background map of an MBTiles file."""

import asyncio
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

pytest.importorskip("nicegui", reason="the extra app is not installed")
from faao_mav.app.serve import Guard, TileFile
from faao_mav.cli.main import app

TOKEN, HOST = "s3cret", "127.0.0.1:8000"
COOKIE, HERE = f"faao-app-8000={TOKEN}", f"http://{HOST}"


async def behind(scope: Any, receive: Any, send: Any) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
    else:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"the page"})


def octets(value: Any) -> bytes:
    return value if isinstance(value, bytes) else str(value).encode()


def ask(path: str = "/", kind: str = "http", method: str = "GET", query: Any = "",
        **headers: Any) -> list[dict[str, Any]]:  # fmt: skip
    given = {"host": HOST, **headers}
    scope = {
        "type": kind, "method": method, "path": path, "query_string": octets(query),
        "headers": [(name.encode(), octets(value)) for name, value in given.items()],
    }  # fmt: skip
    sent = list[dict[str, Any]]()

    async def send(message: Any) -> None:
        sent.append(message)

    guard: Any = Guard(behind, TOKEN, ("127.0.0.1", "localhost"), 8000)
    asyncio.run(guard(scope, None, send))
    return sent


def refused(**asked: Any) -> bool:
    """Whether nothing of the page is in the answer to a request or a websocket."""
    answer = ask(**asked)
    if asked.get("kind") == "websocket":
        return answer == [{"type": "websocket.close", "code": 1008, "reason": ""}]
    return answer[0]["status"] == 403 and b"the page" not in answer[1]["body"]


def test_the_token_in_the_address_becomes_a_cookie_with_which_the_page_is_served() -> None:
    start, _ = ask("//elsewhere.org", query=f"token={TOKEN}&a=b")
    headers = dict(start["headers"])
    assert start["status"] == 303
    assert headers[b"location"] == b"/elsewhere.org?a=b"
    cookie = {*headers[b"set-cookie"].decode().split("; ")}
    assert cookie == {COOKIE, "Path=/", "HttpOnly", "SameSite=lax"}
    assert ask(query=f"token={TOKEN}", cookie=COOKIE)[0]["status"] == 303  # a second window
    start, body = ask(cookie=f"other=1; {COOKIE}")
    assert (start["status"], body["body"]) == (200, b"the page")
    policy = dict(start["headers"])[b"content-security-policy"].decode()
    assert "default-src 'self'" in policy
    assert ask(method="POST", origin=HERE, cookie=COOKIE)[0]["status"] == 200
    local = {"origin": "http://localhost:8000", "host": "localhost:8000"}
    assert ask(kind="websocket", **local, cookie=COOKIE)[0]["type"] == "websocket.accept"


def test_others_get_nothing() -> None:
    """Neither another user of the machine, nor a page from elsewhere, nor another name."""
    cookies = ("", "faao-app-8000=x", "faao-app-1=s3cret", "\x7f;;=")
    for query, cookie in [*(("", each) for each in cookies), ("token=", ""), ("token=s3cre", "")]:
        for path in ("/", "/_nicegui/x.js"):
            assert refused(path=path, query=query, cookie=cookie)
        assert refused(kind="websocket", origin=HERE, cookie=cookie)
    odd = ["http://evil.org", "null", "http://127.0.0.1:8001", f"{HERE}.evil.org", HOST, "",
           "http://[", "http://[::1", f"http://u@{HOST}", f"//{HOST}", f"x://{HOST}"]  # fmt: skip
    for asked in ({}, {"method": "POST"}, {"kind": "websocket"}):
        for origin in odd:
            assert refused(**asked, origin=origin, cookie=COOKIE)
        assert not asked or refused(**asked, cookie=COOKIE)  # without an origin
    assert refused(host="evil.org:8000", cookie=COOKIE)
    assert refused(host="127.0.0.1:1", query=f"token={TOKEN}")


ODD = st.one_of(
    st.binary(max_size=60),
    st.text(alphabet="[]@:/?#%;=,&\\\"' \t\r\n\0\x7f", max_size=30),
    st.text(max_size=30),
    st.sampled_from([HOST, HERE, f"token={TOKEN[:-1]}", COOKIE[:-1], "http://["]),
)


@settings(max_examples=20)
@given(
    path=st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=20),
    kind=st.sampled_from(["http", "websocket"]),
    method=st.sampled_from(["GET", "HEAD", "POST", "PUT", "OPTIONS", "X"]),
    query=ODD,
    headers=st.dictionaries(st.sampled_from(["host", "origin", "cookie", "x"]), ODD),
)
def test_whatever_is_sent_without_the_token_is_refused_cleanly(
    headers: dict[str, Any], query: str | bytes, **asked: Any
) -> None:
    assert refused(**asked, query=query, **headers)
    # nor is there a traceback for who has it
    ask(**asked, query=query, **{**headers, "cookie": COOKIE})
    ask(asked["path"], query=f"token={TOKEN}&".encode() + octets(query))


# ---- the background map

SCHEMA = """CREATE TABLE metadata (name text, value text);
CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob);"""


def mbtiles(
    path: Path,
    rows: tuple[tuple[object, ...], ...],
    told: tuple[tuple[str, str], ...] = (("format", "png"),),
) -> Path:
    """Write an MBTiles file with the `rows` of its tiles and what is `told` of them."""
    with closing(sqlite3.connect(path)) as data, data:
        data.executescript(SCHEMA)
        data.executemany("INSERT INTO metadata VALUES (?, ?)", told)
        data.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", rows)
    return path


def test_rows_are_counted_from_the_north(tmp_path: Path) -> None:
    rows = ((0, 0, 0, b"all"), (2, 1, 0, b"south"), (2, 1, 3, b"north"), (2, 2, 2, "no picture"))
    told = (("format", "jpg"), ("attribution", '<a href="x">me & <script>you'))
    file = TileFile(mbtiles(tmp_path / "a map?#.mbtiles", rows, told))
    assert (file.tile(0, 0, 0), file.tile(2, 1, 0), file.tile(2, 1, 3)) == (
        b"all", b"north", b"south"
    )  # fmt: skip
    for place in ((2, 1, 1), (2, 2, 1), (2, 4, 0), (2, 0, -1), (-1, 0, 0), (99, 0, 0)):
        assert file.tile(*place) is None
    assert file.media_type == "image/jpeg"
    background = {"url": "tiles/{z}/{x}/{y}", "attribution": "me &amp; you", "deepest": 2}
    assert file.background == background


def test_a_file_that_is_no_map_is_one_clear_error(tmp_path: Path) -> None:
    path = tmp_path / "field.mbtiles"
    for write, told in (
        (lambda: None, "there is no such file"),
        (lambda: path.write_bytes(b""), "not an MBTiles file: no such table: metadata"),
        (lambda: path.write_bytes(b"x" * 4096), "not an MBTiles file: file is not a database"),
        (lambda: mbtiles(path, ()), "there are no tiles in it"),
        (lambda: mbtiles(path, (("z", 0, 0, b""),)), "there are no tiles in it"),
        (lambda: mbtiles(path, ((0, 0, 0, b""),), ()), "format None; expected one of png"),
        (lambda: mbtiles(path, ((0, 0, 0, b""),), (("format", "pbf"),)), "format pbf"),
    ):
        path.unlink(missing_ok=True)
        write()
        result = CliRunner().invoke(app, ["app", "--no-browser", "--mbtiles", str(path)])
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert f"--mbtiles {path}: " in result.stderr
        assert told in result.stderr
