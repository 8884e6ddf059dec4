"""Build hook of the site: fills in what the package itself says.

A page holds lines `<!-- generated: WHAT -->`; the hook replaces them by Markdown. WHAT is

- `file NAME`: a file beside this folder, as README.md, with links as seen from here;
- `code NAME`: a script below this folder, as a block of code;
- `plan`: the keys of plan.yaml, one table per section, from the schema;
- `command NAME`: usage and options of a command, from its `--help`;
- `rules`: the rules of `faao-mission validate --rules`;

The reference is mkdocstrings'; `Examples` makes code of the examples in docstrings.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import griffe
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.plan.keys import PlanKey, reference
from faao_mav.validate import RULES

_DOCS = Path(__file__).parent
_MARK = re.compile(r"^<!-- generated: (\w+) ?([\w./]*) -->$", re.MULTILINE)
_OPTION = re.compile(r"^  (-.*?)(?:  +|\n +)((?:.|\n   )*)$", re.MULTILINE)
"""An option and what it is for, on the same or on the next lines of a `--help`."""
_EXAMPLE = re.compile(r"^>>> .*(?:\n(?!\n).*)*", re.MULTILINE)
_BRACES = str.maketrans("", "", "{}")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace the marks of a page; the name and arguments are those that MkDocs expects."""
    return _MARK.sub(lambda mark: _WRITERS[mark[1]](*filter(None, [mark[2]])), markdown)


def file(name: str) -> str:
    """Return a file of the folder above, with links and pictures as seen from docs/."""
    text = (_DOCS.parent / name).read_text(encoding="utf-8")
    text = re.sub(r"\]\(docs/", "](", text)
    return re.sub(r"\]\(([A-Z]+)\.md\)", lambda link: f"]({link[1].lower()}.md)", text)


def code(name: str) -> str:
    """Return a script below docs/ as a block of code."""
    return f"```python\n{(_DOCS / name).read_text(encoding='utf-8')}```"


def plan() -> str:
    """Return the keys of plan.yaml: a heading and a table for each section."""
    lines = []
    for section in ("", *(key.path for key in reference().values() if key.inside)):
        inside = [key for key in reference().values() if key.path.rpartition(".")[0] == section]
        rows = [_row(key) for key in inside if not key.inside]
        if rows:
            lines += [f"### {section or 'At the top'}", "", _about(section), ""]
            lines += ["| key | meaning | accepted | default |", "|---|---|---|---|", *rows, ""]
    return "\n".join(lines)


def _about(section: str) -> str:
    if not section:
        return ""
    key = reference()[section]
    listed = f" Give {key.accepted}." if not key.accepted.startswith("a mapping") else ""
    return _escaped(key.description + listed)


def _row(key: PlanKey) -> str:
    default = "required" if key.required else f"`{key.default}`" if key.default else "none"
    name, accepted = key.path.rpartition(".")[2], _escaped(key.accepted)
    return f"| `{name}` | {_escaped(key.description)} | {accepted} | {default} |"


def command(name: str) -> str:
    """Return usage line and table of options of a command."""
    shown = (
        CliRunner()
        .invoke(app, [name, "--help"], prog_name="faao-mission", terminal_width=400)
        .stdout
    )
    usage, _, options = shown.partition("Options:\n")
    words = usage.splitlines()[0].removeprefix("Usage: ").replace("[OPTIONS]", "").split()
    if name == "plan":  # the command of an argument list that names none
        words.remove(name)
    lines = ["```text", " ".join([*words, "[options]"]).translate(_BRACES), "```", ""]
    lines += ["| option | meaning |", "|---|---|"]
    for option, meaning in _OPTION.findall(options):
        lines.append(f"| `{option.replace('|', ', ')}` | {_escaped(' '.join(meaning.split()))} |")
    return "\n".join(lines)


def rules() -> str:
    """Return the table of validation rules."""
    lines = ["| rule | level | says | source |", "|---|---|---|---|"]
    for rule in RULES:
        summary, source = _escaped(rule.summary), _escaped(rule.source)
        lines.append(f"| `{rule.id}` | {rule.level.name.lower()} | {summary} | {source} |")
    return "\n".join(lines)


class Examples(griffe.Extension):
    """Fences what begins with `>>>` in docstrings, up to the next empty line."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of an object that was read."""
        if obj.docstring is not None:
            obj.docstring.value = _EXAMPLE.sub(r"```pycon\n\g<0>\n```", obj.docstring.value)


_WRITERS: dict[str, Callable[..., str]] = {
    "file": file,
    "code": code,
    "plan": plan,
    "command": command,
    "rules": rules,
}


def _escaped(text: str) -> str:
    # In braces at the end of a cell the site's Markdown looks for attributes.
    return text.replace("|", "\\|").replace("<", "&lt;").replace("{", "&#123;")
