"""Every rule there is."""

from faao_mav.validate import (
    arming_ardupilot,
    extent,
    feasibility_px4,
    fences,
    flight_ardupilot,
    flight_px4,
    items,
    landing_px4,
    link,
    shape,
    speeds,
    storage,
    upload,
)
from faao_mav.validate.rule import Rule

RULES: tuple[Rule, ...] = (
    *items.RULES,
    *upload.RULES,
    *storage.RULES,
    *arming_ardupilot.RULES,
    *flight_ardupilot.RULES,
    *feasibility_px4.RULES,
    *landing_px4.RULES,
    *flight_px4.RULES,
    *speeds.RULES,
    *shape.RULES,
    *extent.RULES,
    *fences.RULES,
    *link.RULES,
)
"""All rules, in the order in which findings about one item are given."""
