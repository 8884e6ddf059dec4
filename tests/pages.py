"""What README and the pages of docs/ show: their blocks, and when a printed text is as shown.

A fenced block is of one kind, by the word after its fence:

- `console`: lines `$ COMMAND`, each with the output that follows it, both streams together. A
  line `...` stands for any lines. A command that ends in ` &` runs until the page ends. Port 14550
  stands for a free one.
- `python`: one namespace a page. A `text` block right after it is what it prints.
- `sh`: commands without output, not run; options and files in them have to exist.
- `yaml`, `text`: shown only.

Blocks of a page are run in their order, in one folder.

`<!-- not run: REASON -->` in the line before a block keeps it from being run.

Numbers are as shown within one unit of the last digit shown (whole numbers: when rounded); where
an exponent is shown, within a factor of ten. Times that the machine takes are not compared.
"""

import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
}

_BLOCK = re.compile(
    r"^(?:<!-- (not run): .* -->\n)?(?P<fence>```+) ?(\w*).*\n(?P<text>(?:.*\n)*?)(?P=fence)$",
    re.MULTILINE,
)
_NUMBER = re.compile(r"(?<![\w.])-?\d[\d]*(?:\.\d+)?(?:e[-+]?\d+)?")
_MACHINE_TIME = re.compile(r"^((?:optimiser|verified) .*?)\d+(?:\.\d+)? s\b", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: its kind, its text, and whether it is to be run."""

    kind: str
    text: str
    run: bool

    @property
    def commands(self) -> list[tuple[str, str]]:
        """The commands of a `console` block with their outputs; none in others."""
        if self.kind != "console":
            return []
        parts = re.split(r"^\$ (.*)\n", self.text, flags=re.MULTILINE)
        return list(zip(parts[1::2], parts[2::2], strict=True))


def blocks(page: str) -> list[Block]:
    """Return the fenced blocks of a page in their order."""
    found = _BLOCK.finditer(PAGES[page])
    return [Block(each[3], each["text"], each[1] is None) for each in found]


def difference(shown: str, printed: str) -> str | None:
    """Return what a page shows and is not printed; None where `printed` is as `shown`."""
    left = _lines(printed)
    skipping = False
    for line in _lines(shown):
        if line == "...":
            skipping = True
            continue
        while left and skipping and not _same(line, left[0]):
            left.pop(0)
        if not left or not _same(line, left.pop(0)):
            return f"shown:   {line}\nprinted: {printed}"
        skipping = False
    return None if skipping or not left else f"not shown: {left[0]}"


def _lines(text: str) -> list[str]:
    timeless = _MACHINE_TIME.sub(r"\1(time)", text)
    return [" ".join(line.split()) for line in timeless.strip("\n").splitlines()]


def _same(shown: str, printed: str) -> bool:
    if _NUMBER.sub("#", shown) != _NUMBER.sub("#", printed):
        return False
    numbers = zip_longest(_NUMBER.findall(shown), _NUMBER.findall(printed))
    return all(_same_number(one, other) for one, other in numbers)


def _same_number(shown: str, printed: str) -> bool:
    value, other = float(shown), float(printed)
    if "e" in shown:
        return value == other or 0.1 <= value / other <= 10
    decimals = len(shown.partition(".")[2])
    if not decimals:
        return value == round(other)
    return abs(value - other) <= 1.0001 * 10.0**-decimals
