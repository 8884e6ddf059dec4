"""Files are written whole or not at all."""

import os
from pathlib import Path

import pytest

from faao_mav.errors import InputError
from faao_mav.files import check_writable, write_whole


def test_content_arrives_and_replaces(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    write_whole(path, b"one")
    write_whole(path, b"two")
    assert path.read_bytes() == b"two"
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_mode & 0o777 == 0o666 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_a_failure_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file.txt"
    write_whole(path, b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match=r"file\.txt: cannot be written: No space left"):
        write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no directory"):
        check_writable(tmp_path / "absent" / "file.txt")
    with pytest.raises(InputError, match="is a directory"):
        check_writable(tmp_path)
    with pytest.raises(InputError, match="cannot be written"):
        write_whole(tmp_path / "absent" / "file.txt", b"")
    check_writable(tmp_path / "file.txt")
    assert list(tmp_path.iterdir()) == []
