"""The plan's keys as fields, generated from the schema: unit, help, default, and what is wrong."""

from collections.abc import Callable, Mapping

from nicegui import ui

from faao_mav.app.document import Document, Path
from faao_mav.plan.keys import PlanKey, reference

_LEFT_OUT = ("study",)
"""Sections that the page takes no notice of."""


def _is_field(key: PlanKey, known: Mapping[str, PlanKey]) -> bool:
    above = known.get(key.path.rpartition(".")[0])
    in_list = above is not None and above.inside and not _is_section(above)
    return not _is_section(key) and not in_list and key.path.split(".")[0] not in _LEFT_OUT


def _is_section(key: PlanKey) -> bool:
    return bool(key.inside) and key.accepted.startswith("a mapping")


def fields() -> tuple[PlanKey, ...]:
    """Return the keys that have a field, in the order of the plan reference.

    >>> [key.path for key in fields()][:3]
    ['name', 'site.origin.latitude', 'site.origin.longitude']
    """
    known = reference()
    return tuple(key for key in known.values() if _is_field(key, known))


class Form:
    """The fields of a document; `changed` is called after one was written."""

    def __init__(self, document: Document, changed: Callable[[], None]) -> None:
        self._document, self._changed = document, changed
        self._inputs: dict[str, ui.input | ui.select] = {}

    def build(self) -> None:
        """Make the fields, one panel for each section of the file."""
        known = reference()
        panels: dict[str, ui.element] = {}
        for key in fields():
            section = key.path.rpartition(".")[0]
            if section not in panels:
                panel = ui.expansion(section or "plan", value=section in ("", "flight"))
                panel.classes("w-full section").props("dense header-class=section-head")
                panels[section] = panel
                if section:
                    with panel:
                        ui.label(known[section].description).classes("about")
            with panels[section]:
                self._inputs[key.path] = self._field(key)

    def show(self) -> None:
        """Show the values of the document."""
        for name, shown in self._inputs.items():
            value = self._document.shown(_path(name))
            held = value or None if isinstance(shown, ui.select) else value
            if shown.value != held:
                shown.value = held

    def tell(self, problems: Mapping[str, str]) -> None:
        """Show what is wrong with the fields, by their paths, and only that."""
        for name, shown in self._inputs.items():
            problem = problems.get(name)
            if (shown.props.get("error-message") or None) != problem:
                shown.props["error"], shown.props["error-message"] = problem is not None, problem
                shown.update()

    def _field(self, key: PlanKey) -> ui.input | ui.select:
        name = key.path.rpartition(".")[2]
        label = f"{name}, {key.unit}" if key.unit else name
        default = "Required." if key.required else f"Default: {key.default or 'none'}."

        def commit() -> None:
            value = shown.value or ""
            if str(value) != self._document.shown(_path(key.path)):
                self._document.write(_path(key.path), str(value))
                self._changed()

        shown: ui.input | ui.select
        if key.choices:
            shown = ui.select([*key.choices], label=label, clearable=True)
            shown.on_value_change(commit)
        else:
            shown = ui.input(label=label).on("keydown.enter", commit).on("blur", commit)
        shown.props["hint"] = f"{key.description} {default}"
        shown.props(f'dense bottom-slots data-key="{key.path}"').classes("w-full")
        return shown


def _path(name: str) -> Path:
    return tuple(name.split("."))
