"""Files are written whole or not at all."""

import io
import os
import sys
from pathlib import Path

import pytest

from faao_mav.errors import InputError, PlanError
from faao_mav.files import check_apart, check_writable, read_text, write_together, write_whole


def test_content_arrives_and_replaces(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    longest, link, real = tmp_path / ("a" * 255), tmp_path / "link", tmp_path / "below" / "real"
    link.symlink_to(real)
    mask = os.umask(0o027)
    for path in (longest, link):
        for content in (b"one", b"two"):
            check_writable(path)
            write_whole(path, content)
            assert path.read_bytes() == content
    os.umask(mask)
    assert link.is_symlink()
    assert {*tmp_path.iterdir()} == {longest, link, real.parent}
    assert [each.stat().st_mode & 0o777 for each in (longest, real)] == [0o640, 0o640]


def test_a_failure_leaves_the_old_files_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, other = tmp_path / "file.txt", tmp_path / "other.txt"
    write_together({path: b"old", other: b"old"})
    with pytest.raises(InputError, match="absent/c: cannot be written"):
        write_together({path: b"new", tmp_path / "absent" / "c": b"new"})

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match=r"file\.txt: cannot be written: No space left"):
        write_whole(path, b"new")
    assert path.read_bytes() == other.read_bytes() == b"old"
    assert {*tmp_path.iterdir()} == {path, other}


def test_what_is_no_place_for_a_file_or_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")  # opening it would wait for a writer
    for path, told in (
        (tmp_path / "absent" / "file.txt", "there is no directory"),
        (tmp_path, "is a directory"),
        (tmp_path / ("a" * 300), "cannot be written: File name too long"),
        (tmp_path / "pipe", "is a device or a pipe"),
        (Path("/dev/null"), "is a device or a pipe"),
    ):
        with pytest.raises(InputError, match=told):
            check_writable(path)
        if "device" in told:
            with pytest.raises(PlanError, match=f"{told}; give the name of a file"):
                read_text(path, 1000, "a plan", PlanError)
    with pytest.raises(InputError, match="cannot be written"):
        write_whole(tmp_path / "absent" / "file.txt", b"")
    check_writable(tmp_path / "file.txt")
    assert [each.name for each in tmp_path.iterdir()] == ["pipe"]


def test_no_file_is_written_over_another_of_the_same_command(tmp_path: Path) -> None:
    plan, other = tmp_path / "plan.txt", tmp_path / "other.txt"
    plan.write_text("plan")
    (tmp_path / "link.txt").symlink_to(plan)
    (tmp_path / "hard.txt").hardlink_to(plan)
    check_apart({"--out": other, "--save": None}, {"PLAN": plan, "SOLUTION": None})
    for name in ("plan.txt", "../" + tmp_path.name + "/plan.txt", "link.txt", "hard.txt"):
        with pytest.raises(InputError, match=r"^--out .* is the file of PLAN too"):
            check_apart({"--out": tmp_path / name}, {"PLAN": plan})
    with pytest.raises(InputError, match=r"^--save .* is the file of --out too"):
        check_apart({"--out": other, "--save": other}, {"PLAN": plan})


def test_text_is_utf_8_within_a_limit_also_from_standard_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for content, told in (
        (b"\xef\xbb\xbfname: x", None),
        (b"x" * 101, "more than 100 bytes; expected a plan"),
        (b"\xef\xbb\xbfa: 1\nb: \xff\n", "line 2: byte 0xff is not UTF-8"),
    ):
        path = tmp_path / "plan"
        path.write_bytes(content)
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content)))
        for name in (str(path), "-"):
            if told is None:
                assert read_text(name, 100, "a plan", PlanError) == "name: x"
                continue
            with pytest.raises(PlanError, match=f"{name}: {told}"):
                read_text(name, 100, "a plan", PlanError)
