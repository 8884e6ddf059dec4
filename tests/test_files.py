"""Files are written whole or not at all."""

import io
import os
import sys
from pathlib import Path

import pytest
from full_disk import files_of_at_most

from faao_mav.errors import InputError, PlanError
from faao_mav.files import (
    append_whole,
    check_apart,
    check_writable,
    cut,
    read_text,
    write_together,
    write_whole,
)


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


def test_what_is_added_is_added_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "rows"
    append_whole(path, b"one\n")
    append_whole(path, b"two\n")
    with (
        files_of_at_most(10),
        pytest.raises(InputError, match="rows: cannot be written: File too large"),
    ):
        append_whole(path, b"three\n")  # two of its bytes fit
    assert path.read_bytes() == b"one\ntwo\n"
    append_whole(path, b"three\n")
    cut(path, 4)
    assert path.read_bytes() == b"one\n"
    for full in (tmp_path / "absent" / "rows", Path("/dev/full")):
        with pytest.raises(InputError, match=f"{full}: cannot be written"):
            append_whole(full, b"x")


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no directory"):
        check_writable(tmp_path / "absent" / "file.txt")
    with pytest.raises(InputError, match="is a directory"):
        check_writable(tmp_path)
    with pytest.raises(InputError, match="cannot be written"):
        write_whole(tmp_path / "absent" / "file.txt", b"")
    check_writable(tmp_path / "file.txt")
    assert list(tmp_path.iterdir()) == []


def test_names_that_are_no_place_for_a_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written: File name too long"):
        check_writable(tmp_path / ("a" * 300))
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/null")):
        with pytest.raises(InputError, match="is a device or a pipe"):
            check_writable(path)


def test_what_is_no_file_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")  # opening it would wait for a writer
    for path in (tmp_path / "pipe", Path("/dev/null")):
        with pytest.raises(PlanError, match="is a device or a pipe; give the name of a file"):
            read_text(path, 1000, "a plan", PlanError)


def test_the_longest_name_that_there_is(tmp_path: Path) -> None:
    path = tmp_path / ("a" * 255)
    check_writable(path)
    write_whole(path, b"whole")
    assert path.read_bytes() == b"whole"


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    link, real = tmp_path / "link.txt", tmp_path / "below" / "real.txt"
    real.write_bytes(b"old")
    link.symlink_to(real)
    write_whole(link, b"new")
    assert link.is_symlink()
    assert real.read_bytes() == b"new"


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


def test_files_that_belong_together_are_written_all_or_none(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    write_together({first: b"1", second: b"2"})
    with pytest.raises(InputError, match="absent/c: cannot be written"):
        write_together({first: b"new", tmp_path / "absent" / "c": b"new"})
    assert [path.read_bytes() for path in sorted(tmp_path.iterdir())] == [b"1", b"2"]


def test_standard_input_is_a_file_to_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"\xef\xbb\xbfname: x")))
    assert read_text("-", 100, "a plan", PlanError) == "name: x"
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"x" * 101)))
    with pytest.raises(PlanError, match="-: more than 100 bytes; expected a plan"):
        read_text("-", 100, "a plan", PlanError)


def test_the_place_of_a_byte_that_is_no_text_counts_the_mark_before_it(tmp_path: Path) -> None:
    (tmp_path / "plan").write_bytes(b"\xef\xbb\xbfa: 1\nb: \xff\n")
    with pytest.raises(PlanError, match="plan: line 2: byte 0xff is not UTF-8"):
        read_text(tmp_path / "plan", 100, "a plan", PlanError)
