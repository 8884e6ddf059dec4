"""The planner page: drag stations, draw zones, see the flight; served on loopback by NiceGUI.

`document` and `scene` hold the plan that is edited, `workers` ask processes for `answers`,
`vehicle` uploads, watches and debriefs beside it, `page` shows it all. Only `page`, its parts
`panels` and `fly`, and `serve` know NiceGUI.
"""
