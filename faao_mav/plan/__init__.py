"""The plan: `plan.yaml` read, checked and turned into SI units.

`sections`, `vehicle` and `radio` declare the keys and what they mean, `model` has the whole plan,
`reader` reads it, `keys.reference` lists them.
"""

from faao_mav.plan.keys import reference as reference
from faao_mav.plan.radio import Radio as Radio
from faao_mav.plan.reader import Plan as Plan
from faao_mav.plan.reader import parse_plan as parse_plan
from faao_mav.plan.reader import read_plan as read_plan
from faao_mav.plan.sections import Wind as Wind
from faao_mav.vector import Vector as Vector
