"""Inputs near sound ones: mutations of text by its words and numbers, of archives and of bytes."""

import io
import re
import zipfile
from collections.abc import Callable, Sequence
from random import Random

_WORD = re.compile(rb"[A-Za-z_]+|[0-9.]+|[ \t]+|[^A-Za-z_0-9. \t]")
"""Words, numbers, runs of blanks and single other bytes, which together are the whole text."""

_ODD = (
    *(b"0", b"-1", b"1e-300", b"1e-6", b"3.41e38", b"1e308", b"1e999999", b"-0.0", b"NaN", b"inf"),
    *(b"Infinity", b"65535", b"65536", b"2147483648", b"9" * 5000, b"0x1F", b"1_000", b"1:0:0"),
    *(b"null", b"true", b"[]", b"{}", b'""', b"[[[[", b"{a: b}", b"~", b"*a", b"&a", b"!!float"),
    *(b"!!timestamp", b"<<: ", b"---", b"...", b"? ", b"|", b">", b"%YAML 1.1\n", b"\\u0000"),
    *(b"\x00", b"\xff", b"\xe2\x80\xae", b"\x1b[2J", b"\xef\xbb\xbf", b"\r", b"\x0b", b"\xc2\x85"),
    *(b"\xed\xa0\x80", b'"\\ud800"', b"<!ENTITY a 'b'>", b"&a;", b"]]>", b"<!--"),
)
"""What stands in place of a word: limits of numbers, words of the formats, odd characters."""

_MOST_REPEATS = 3000
"""Times that a part is repeated at most; chosen: 100 kB in a short time."""

_NUMPY_HEADERS = (
    *(b"'<f8'", b"'|O'", b"'<U5'", b"'<c16'", b"'|S0'", b"'<M8[s]'", b"[('a', '<f8')]", b"'>f4'"),
    *(
        b"(3,)",
        b"(0,)",
        b"()",
        b"(20, 2)",
        b"(1000000000,)",
        b"(99999, 99999)",
        b"(-1,)",
        b"(1e9,)",
    ),
    *(b"True", b"None", b"lambda: 0", b"(" * 300),
)
"""What stands in place of a word of an array's header: types, shapes and what is neither."""


_MAGIC = 10
"""Bytes before the literal in an array's header: magic, version and the literal's length."""


def text(content: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Return `content` after one to four changes of its words; parts come from the `others` too."""
    words = _WORD.findall(content)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        random.choice(_CHANGES)(words, others, random)
    return b"".join(words)


Change = Callable[[list[bytes], Sequence[bytes], Random], None]


def _part(words: list[bytes], random: Random) -> slice:
    start = random.randrange(len(words) + 1)
    return slice(start, start + random.choice((1, 1, 2, 5, 20, 100)))


def _replace(words: list[bytes], others: Sequence[bytes], random: Random) -> None:
    start = random.randrange(len(words) + 1)
    words[start : start + 1] = [random.choice(_ODD)]


def _insert(words: list[bytes], others: Sequence[bytes], random: Random) -> None:
    words.insert(random.randrange(len(words) + 1), random.choice(_ODD))


def _delete(words: list[bytes], others: Sequence[bytes], random: Random) -> None:
    del words[_part(words, random)]


def _repeat(words: list[bytes], others: Sequence[bytes], random: Random) -> None:
    part = _part(words, random)
    times = random.choice((2, 2, 2, 10)) if random.random() < 0.99 else _MOST_REPEATS
    words[part] = words[part] * times


def _move(words: list[bytes], others: Sequence[bytes], random: Random) -> None:
    part = words[_part(words, random)]
    place = random.randrange(len(words) + 1)
    words[place:place] = part


def _splice(words: list[bytes], others: Sequence[bytes], random: Random) -> None:
    other = _WORD.findall(random.choice(others)[:10_000])
    words[_part(words, random)] = other[_part(other, random)]


def _flip(words: list[bytes], others: Sequence[bytes], random: Random) -> None:
    if words:
        place = random.randrange(len(words))
        word = bytearray(words[place])
        word[random.randrange(len(word))] = random.randrange(256)
        words[place] = bytes(word)


def _cut(words: list[bytes], others: Sequence[bytes], random: Random) -> None:
    del words[random.randrange(len(words) + 1) :]


_CHANGES: tuple[Change, ...] = (_replace, _insert, _delete, _repeat, _move, _splice, _flip, _cut)


def archive(content: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Return a NumPy archive with one to four of its bytes, members or array headers changed."""
    if random.random() < 0.3:
        return _bytes_changed(content, random)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            members = {name: file.read(name) for name in file.namelist()}
    except Exception:  # a finding of the corpus need not be an archive
        return _bytes_changed(content, random)
    for _ in range(random.choice((1, 1, 2, 4))):
        _change_member(members, others, random)
    packed = io.BytesIO()
    how = random.choice((zipfile.ZIP_STORED, zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(packed, "w", how) as file:
        for name, data in members.items():
            file.writestr(name, data)
    return packed.getvalue()


def binary(content: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Return `content` with some bytes changed, or a part of it left out, repeated or moved."""
    if random.random() < 0.5:
        return _bytes_changed(content, random)
    words = [content[at : at + 16] for at in range(0, len(content), 16)]
    random.choice((_delete, _repeat, _move, _flip, _cut))(words, others, random)
    return b"".join(words)


def _bytes_changed(content: bytes, random: Random) -> bytes:
    data = bytearray(content)
    # half of the changes are in the directory of the archive, which is at its end
    first = random.choice((0, max(0, len(data) - 2000)))
    for _ in range(random.choice((1, 2, 8))):
        if first < len(data):
            data[random.randrange(first, len(data))] = random.choice(
                (0, 1, 255, random.randrange(256))
            )
    return bytes(data[: random.randrange(len(data) + 1)] if random.random() < 0.1 else data)


def _change_member(members: dict[str, bytes], others: Sequence[bytes], random: Random) -> None:
    if not members:
        return
    name = random.choice(list(members))
    header, newline, data = members[name].partition(b"\n")
    match random.randrange(6):
        case 0:
            del members[name]
        case 1:
            members[random.choice([*members, "odd.npy", "plan"])] = members[name]
        case 2:  # the header is a Python literal: its words are replaced by types and shapes
            parts = re.split(rb"('[^']*'|\([^)]*\)|True|False)", header[_MAGIC:])
            parts[random.randrange(len(parts))] = random.choice(_NUMPY_HEADERS)
            literal = b"".join(parts) + newline
            size = len(literal).to_bytes(2, "little")
            members[name] = header[: _MAGIC - 2] + size + literal + data
        case 3:
            size = 2 ** random.randrange(1, 17)
            members[name] = header + newline + data[:size] * random.choice((0, 1, 2, 50))
        case 4:
            members[name] = header + newline + text(data, others, random)
        case _:
            members[name] = _bytes_changed(members[name], random)
