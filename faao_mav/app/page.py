"""The page of one window: the map, the plan beside it, what the flight delivers, and its files."""

import json
from collections.abc import Callable
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import nicegui
from nicegui import events, ui

from faao_mav.app.answers import FILES, Answer, made
from faao_mav.app.document import Document, problems_of
from faao_mav.app.panels import Fly, Form, Results, fields
from faao_mav.app.scene import STATIONS, Scene
from faao_mav.app.workers import Planner, Workers
from faao_mav.errors import FaaoError, PlanError
from faao_mav.plan.yaml_text import MAX_CHARACTERS

TILES = "https://tile.openstreetmap.org"
"""Where the background map comes from, if it is switched on."""

_SHAPES = (
    ("circle", "o_circle", "Click the center, then the edge; Esc ends."),
    ("polygon", "o_hexagon", "Click the corners, the last one twice; Esc ends."),
)
"""Shape of a zone, icon of the button that begins one, and how it is drawn."""

_LOOKS = json.loads(files("faao_mav.app").joinpath("charts.json").read_text(encoding="utf-8"))
"""The theme of ECharts for the charts of a flight."""

_LEAFLET = Path(nicegui.__file__).parent / "elements" / "leaflet" / "dist"
"""Leaflet as NiceGUI brings it along."""


class PlannerMap(ui.element, component="map.js", esm={"nicegui-leaflet": str(_LEAFLET)}):
    """Leaflet with the plan's stations, ends, zones and flight; what it does is in map.js.

    Events: `ready`; `moved` (key, at, done); `zone` (key, inclusion, corners or center and radius,
    done); `removed` (key). Methods by `run_method`: those of map.js.
    """

    def __init__(self) -> None:
        super().__init__()
        self.add_resource(_LEAFLET)


class Page:
    """One window: its own document, its own answers.

    Setup, once: `build`; then each event changes the document and ends in `_changed`, which asks
    for answers; `_show` takes them.
    """

    def __init__(self, document: Document, workers: Workers, background: dict[str, Any]) -> None:
        self._document, self._workers, self._background = document, workers, background
        self._planner = Planner(workers, self._show)
        self._answer, self._gestures = Answer(), 0
        self._form = Form(document, self._changed)

    def build(self) -> None:
        """Make the elements of the page."""
        ui.add_css(files("faao_mav.app").joinpath("page.css").read_text(encoding="utf-8"))
        ui.dark_mode(None)
        self._bar()
        with ui.element("main").classes("planner"):
            with ui.element("section").classes("left"):
                self._map_part()
            with ui.element("section").classes("right"):
                self._side_part()
        ui.keyboard(self._key)
        # not on_disconnect: a connection that was lost for a moment comes back
        ui.context.client.on_delete(self._planner.close)
        ui.context.client.on_delete(self._fly.close)

    def _bar(self) -> None:
        with ui.element("header").classes("bar"):
            self._name = ui.label().classes("name")
            with ui.element("div").classes("told").props('aria-live="polite"'):
                self._rate = ui.label().classes("rate")
                self._state = ui.label().classes("state")
            ui.space()
            self._undo = _button("undo", "Undo (Ctrl+Z)", self._document.undo, self._changed)
            self._redo = _button("redo", "Redo (Ctrl+Y)", self._document.redo, self._changed)
            _button("folder_open", "Open a plan", self._open_dialog)
            self._save_button = _button("save", "Save (Ctrl+S)", self._save)
            with _button("download", "Download"), ui.menu():
                ui.menu_item("Plan (.yaml)", self._download_plan)
                for wanted, (label, _) in FILES.items():
                    ui.menu_item(label, partial(self._download, wanted))

    def _map_part(self) -> None:
        self._map = PlannerMap()
        call = self._map.run_method
        with ui.element("div").classes("tools"):
            for inside, name in ((False, "Stay out of"), (True, "Stay in")):
                with ui.element("div").classes("in" if inside else "out"):
                    ui.label(name)
                    for shape, icon, how in _SHAPES:
                        draw = partial(call, "draw", shape, inside)
                        _button(icon, f"{name} a {shape}", draw, partial(ui.notify, how))
            _button("delete", "Delete the chosen zone (Del)", partial(call, "remove_selected"))
            _button("center_focus_strong", "Show all", partial(self._draw_scene, fit=True))
            shown = ui.switch(
                "Background",
                on_change=lambda e: call("background", self._background if e.value else None),
            )
            if self._background["url"].startswith(TILES):
                shown.tooltip("OpenStreetMap: the parts of the map that you look at are asked for "
                              f"from {TILES.removeprefix('https://')}")  # fmt: skip
        self._map.move(target_index=-1)
        self._map.on("ready", self._ready).on("moved", self._moved).on("zone", self._moved)
        self._map.on("removed", self._removed)
        with ui.element("div").classes("time"):
            self._slider = ui.slider(min=0, max=1, value=0, on_change=self._slid)
            self._slider.props('aria-label="Time of the flight"')
            self._now = ui.label().classes("now")
        self._chart_box, self._charts = ui.element("div").classes("charts"), list[ui.echart]()

    def _side_part(self) -> None:
        self._failed = ui.label().classes("failed").props('role="alert"')
        with ui.tabs().props("dense no-caps align=justify") as tabs:
            for tab in ("Plan", "Result", "Findings", "Fly"):
                ui.tab(tab)
        with ui.tab_panels(tabs, value="Plan", keep_alive=True).classes("w-full"):
            with ui.tab_panel("Plan"):
                self._form.build()
            self._results = Results(partial(self._map.run_method, "focus"))
            self._fly = Fly(self._workers, self._map.run_method, self._download)

    def _ready(self) -> None:
        self._draw_scene(fit=True)
        self._changed(soon=False)

    def _changed(self, *, soon: bool = True) -> None:
        """Ask for what the document leads to; what was found before is no longer of it."""
        document = self._document
        self._answer = Answer(drawing=self._answer.drawing)
        self._form.show()
        self._draw_scene()
        self._name.text = document.shown(("name",)) or Path(document.source).name
        self._undo.set_enabled(document.can_undo)
        self._redo.set_enabled(document.can_redo)
        self._save_button.set_enabled(document.path is not None and not document.saved)
        self._fly.show(None)
        self._results.stale()
        self._say("computing")
        self._planner.ask(document.text, document.source, soon=soon)

    def _say(self, state: str) -> None:
        self._state.text = self._state.props["data-state"] = state
        self._state.update()

    def _show(self, answer: Answer) -> None:
        paths = [key.path for key in fields()]
        problems = problems_of(answer.refused, self._document.source, paths)
        self._form.tell(problems)
        self._failed.text = answer.failed or "\n".join(
            f"{path}: {problem}" if path else problem for path, problem in problems.items()
        )
        self._answer = answer
        if not answer.drawing:
            self._rate.text = ""
            self._say("not a plan yet" if problems else "no flight")
            self._map.run_method("clear_flight")
            self._draw_charts()
            self._results.clear()
            self._at_time()
            return
        data = "" if answer.megabytes is None else f", {answer.megabytes:,.1f} MB"
        self._rate.text = f"{answer.delivered:.4f} bit/s/Hz{data}"
        self._rate.props["data-delivered"] = repr(answer.delivered)
        self._say("rough, computing" if answer.result is None else "finished")
        self._map.run_method("flight", answer.drawing)
        self._draw_charts()
        self._slider.props["max"] = len(answer.drawing["times"]) - 1
        self._slider.update()
        self._at_time()
        if answer.result is not None:
            self._results.show(answer.result)
            self._show_flight_to_fly()

    def _show_flight_to_fly(self) -> None:
        document = self._document
        self._fly.show(self._answer.result, document.path if document.saved else None)

    def _draw_charts(self) -> None:
        """Draw the charts of the answer: on those that are there, as new ones take longer."""
        charts = self._answer.charts
        if len(charts) == len(self._charts):
            for shown, chart in zip(self._charts, charts, strict=True):
                shown.run_chart_method("setOption", chart, True)
            return
        self._chart_box.clear()
        with self._chart_box:
            self._charts = [ui.echart(chart, theme=_LOOKS) for chart in charts]

    def _draw_scene(self, *, fit: bool = False) -> None:
        scene = Scene(self._document)
        self._map.run_method("scene", scene.stations(), scene.zones(), fit)

    def _moved(self, event: events.GenericEventArguments) -> None:
        """Take a station, or a zone, to where it was dragged; a whole drag is one step of undo."""
        told, scene = event.args, Scene(self._document)
        gesture = (told["key"], self._gestures)
        if told["key"] in STATIONS:
            scene.move(told["key"], told["at"], gesture)
        else:
            scene.change(told, gesture)
        self._gestures += bool(told["done"])
        self._changed()

    def _removed(self, event: events.GenericEventArguments) -> None:
        Scene(self._document).remove(event.args["key"])
        self._changed()

    def _at_time(self) -> None:
        drawn, k = self._answer.drawing, int(self._slider.value)
        flown = 0 < k < len(drawn.get("times", ()))
        self._map.run_method("place_aircraft", drawn["places"][k] if flown else None)
        self._now.text = f"{drawn['times'][k]:.1f} s, {drawn['speeds'][k]:.2f} m/s" if flown else ""

    def _slid(self) -> None:
        self._at_time()
        tip = {"type": "showTip", "seriesIndex": 0, "dataIndex": int(self._slider.value)}
        for chart in self._charts:
            chart.run_chart_method("dispatchAction", tip)

    def _key(self, event: events.KeyEventArguments) -> None:
        if not (event.action.keydown and (event.modifiers.ctrl or event.modifiers.meta)):
            return
        if event.key == "s":
            self._save()
        elif event.key in ("y", "Z", "z"):
            back = event.key == "z" and not event.modifiers.shift
            (self._document.undo if back else self._document.redo)()
            self._changed()

    def _open_dialog(self) -> None:
        async def opened(event: events.UploadEventArguments) -> None:
            try:
                content = (await event.file.read()).decode("utf-8-sig")
                self._document.replace(content, event.file.name)
            except (PlanError, UnicodeDecodeError) as error:
                _complain(error)
                return
            dialog.close()
            self._ready()

        with ui.dialog(value=True) as dialog, ui.card():
            ui.label("Open a plan")
            chosen = ui.upload(on_upload=opened, auto_upload=True, max_file_size=4 * MAX_CHARACTERS)
            chosen.props("accept=.yaml,.yml flat bordered")

    def _save(self) -> None:
        if (path := self._document.path) is None:
            ui.notify("This plan is of no file here: download it", type="warning")
            return
        try:
            self._document.save()
        except FaaoError as error:
            _complain(error)
            return
        self._save_button.set_enabled(False)
        self._show_flight_to_fly()
        ui.notify(f"{path.name} saved", type="positive")

    def _download_plan(self) -> None:
        ui.download.content(self._document.text, Path(self._document.source).name)

    async def _download(self, wanted: str) -> None:
        if self._answer.result is None:
            ui.notify("The flight is not finished yet", type="warning")
            return
        try:
            name, content = await self._workers.long(made, self._answer.result, wanted)
        except FaaoError as error:
            _complain(error)
            return
        ui.download.content(content, name)


def _button(icon: str, tip: str, *acts: Callable[[], object]) -> ui.button:
    button = ui.button(icon=icon, on_click=lambda: [act() for act in acts])
    return button.props(f'flat dense round aria-label="{tip}"').tooltip(tip)


def _complain(error: Exception) -> None:
    ui.notify(str(error), type="negative", multi_line=True)
