"""The planner page: drag stations, draw zones, see the flight; served on loopback by NiceGUI.

`document` and `scene` hold the plan that is edited, `planner` asks worker processes for `answers`,
`page` shows them. Only `page`, `form`, `charts`, `map` and `serve` know NiceGUI.
"""
