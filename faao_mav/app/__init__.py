"""The planner page: drag stations, draw zones, see the flight; served on loopback by NiceGUI.

`document` and `scene` hold the plan that is edited, `workers` ask processes for `answers`,
`vehicle` uploads, watches and debriefs beside it, `page` and `panels` show it all. Only these two
and `serve` know NiceGUI.
"""
