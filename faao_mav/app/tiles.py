"""The background map: tiles of a file for the field, or of OpenStreetMap."""

import re
import sqlite3
from contextlib import closing
from html import escape
from pathlib import Path
from typing import Any

from faao_mav.app.guard import TILES
from faao_mav.errors import InputError

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
        with closing(sqlite3.connect(f"{self._path.resolve().as_uri()}?mode=ro", uri=True)) as data:
            return data.execute(asked, values).fetchall()
