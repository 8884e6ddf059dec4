"""Inputs near sound ones: changes of their words, bytes, datagrams or archived arrays."""

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

_HEADERS = (b"|O", b"<U5", b"|S0", b"<M8[s]", b">f4", b"(0,)", b"()", b"(20, 2)", b"(99999, 99999)",
            b"(-1,)", b"(1e9,)", b"lambda: 0", b"(" * 300)  # fmt: skip
"""What stands in place of a word of an array's header: types, shapes and what is neither."""

_MOST_REPEATS = 3000
"""Times that a part is repeated at most; chosen: 100 kB in a short time."""

Odd = Callable[[bytes, Random], bytes]
"""Makes something odd of one part."""


def changed(parts: list[bytes], others: Sequence[bytes], random: Random, odd: Odd) -> None:
    """Make one to four changes in `parts`; some come from the `others`."""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        start, end = (random.randrange(len(parts) + 1) for _ in range(2))
        part = slice(start, start + random.choice((1, 1, 2, 5, 20, 100)))
        match random.randrange(8):
            case 0:
                parts.insert(start, odd(b"", random))
            case 1:
                del parts[part]
            case 2:
                if random.random() < 0.01:
                    parts[start : start + 1] *= _MOST_REPEATS
                parts[part] *= random.choice((2, 2, 2, 10))
            case 3:
                parts[end:end] = parts[part]
            case 4:
                parts[part] = others[end % (len(others) + 1) :][: part.stop - start]
            case 5:
                del parts[start:]
            case _:
                parts[start : start + 1] = [odd(each, random) for each in parts[start : start + 1]]


def text(content: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Return `content` after a few changes of its words; parts come from the `others` too."""
    words = _WORD.findall(content)
    changed(words, _WORD.findall(random.choice(others)[:10_000]), random, _odd_word)
    return b"".join(words)


def _odd_word(word: bytes, random: Random) -> bytes:
    return damaged(word, random) if word and random.random() < 0.5 else random.choice(_ODD)


def binary(content: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Return `content` with some bytes changed, or a part of it left out, repeated or moved."""
    if random.random() < 0.5:
        return damaged(content, random)
    chunks = [content[at : at + 16] for at in range(0, len(content), 16)]
    changed(chunks, (), random, damaged)
    return b"".join(chunks)


def damaged(content: bytes, random: Random) -> bytes:
    """Return `content` with some bytes changed, and at times cut off."""
    data = bytearray(content)
    # half of the changes are in the directory of an archive, which is at its end
    first = random.choice((0, max(0, len(data) - 2000)))
    for _ in range(random.choice((1, 2, 8))):
        if data:
            odd = random.choice((0, 1, 255, random.randrange(256)))
            data[random.randrange(first, len(data))] = odd
    return bytes(data[: random.randrange(len(data) + 1)] if random.random() < 0.1 else data)


def archive(content: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """Return a NumPy archive with some of its bytes, members or array headers changed."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            members = {name: file.read(name) for name in file.namelist()}
        name = random.choice(list(members))
    except Exception:  # a finding of the corpus need not be an archive
        return damaged(content, random)
    header, newline, data = members[name].partition(b"\n")
    match random.randrange(6):
        case 0:
            del members[name]
        case 1 | 2:  # after magic, version and length, the header is a Python literal
            parts = re.split(rb"('[^']*'|\([^)]*\)|True|False)", header[10:])
            parts[random.randrange(len(parts))] = random.choice(_HEADERS)
            literal = b"".join(parts) + newline
            members[name] = header[:8] + len(literal).to_bytes(2, "little") + literal + data
        case 3:
            members[name] = header + newline + text(data, others, random)
        case 4:
            members[name] = damaged(members[name], random)
        case _:
            return damaged(content, random)
    packed = io.BytesIO()
    with zipfile.ZipFile(
        packed, "w", random.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    ) as file:
        for name, data in members.items():
            file.writestr(name, data)
    return packed.getvalue()
