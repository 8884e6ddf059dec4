"""The map as an element of the page; what it does is in map.js."""

from pathlib import Path

import nicegui
from nicegui import ui

_LEAFLET = Path(nicegui.__file__).parent / "elements" / "leaflet" / "dist"
"""Leaflet as NiceGUI brings it along."""


class PlannerMap(ui.element, component="map.js", esm={"nicegui-leaflet": str(_LEAFLET)}):
    """Leaflet with the plan's stations, ends, zones and flight.

    Events: `ready`; `moved` (key, at, done); `zone` (key, inclusion, corners or center and radius,
    done); `removed` (key); `cursor` (at). Methods by `run_method`: those of map.js.
    """

    def __init__(self) -> None:
        super().__init__()
        self.add_resource(_LEAFLET)
