"""The background map of an MBTiles file: which picture is where, and files that are none."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

pytest.importorskip("nicegui", reason="the extra app is not installed")
from faao_mav.app.serve import TileFile
from faao_mav.cli.main import app

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
