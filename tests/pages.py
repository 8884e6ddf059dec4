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

How near a printed number has to be to the shown one, by its format and its unit:

- Names, words, whole numbers: exactly. They count, or were given.
- A number with decimals, or with one of the units `_MEASURED`: within a thousandth, and one unit of
  the last digit shown. Optima are that near on any machine, and so are the flights that follow.
- Such a number on a line with a standard error, which has one digit (`2.694 +- 0.002`), is sampled,
  as all on its line are: within three standard errors of the difference of two samples.
- A number with six decimals or more is a latitude or a longitude: within 1e-5 degrees, a metre.
- What belongs to the machine or to the way to the optimum is anything: `took 0.7 s`,
  `8 iterations`, `stationary to 8.3e-05`.
"""

import re
from dataclasses import dataclass
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
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?")
_MACHINE = re.compile(r"\btook \d+(?:\.\d+)? s\b|\b\d+ iterations?\b|\b\d(?:\.\d+)?e-\d+\b")
_ERROR = re.compile(r"\+- (0\.0*[1-9])(?!\d)")
_MEASURED = re.compile(r" (?:m|s|Wh|Mbit/s|megabytes)\b(?!/)")
_SHARE = 1e-3  # of a figure: ten times the tolerance at which the optimiser stops
_ERRORS = 3 * 2**0.5  # errors of one of two samples that differ by three errors of their difference
_DECIMALS_OF_DEGREES = 6  # of a figure; no other quantity is printed with as many
_DEGREES = 1e-5


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
    return [" ".join(line.split()) for line in text.strip("\n").splitlines()]


def _same(shown: str, printed: str) -> bool:
    shown, printed = (_MACHINE.sub("(the machine's)", line) for line in (shown, printed))
    if _NUMBER.sub("#", shown) != _NUMBER.sub("#", printed):
        return False
    error = max(map(float, _ERROR.findall(shown)), default=0.0)
    numbers = zip(_NUMBER.finditer(shown), _NUMBER.findall(printed), strict=True)
    return all(abs(float(one[0]) - float(other)) <= _apart(one, error) for one, other in numbers)


def _apart(number: re.Match[str], error: float) -> float:
    """Return how far a printed number may be from a shown one, with the error on its line."""
    decimals = len(number[0].partition(".")[2])
    if decimals >= _DECIMALS_OF_DEGREES:
        return _DEGREES
    if not decimals and not _MEASURED.match(number.string, number.end()):
        return 0.0
    near = _SHARE * abs(float(number[0])) + 1.0001 * 10.0**-decimals
    is_error = number.string.endswith("+- ", 0, number.start())
    return near if is_error else max(near, _ERRORS * error)
