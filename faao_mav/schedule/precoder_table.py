"""The precoders of every slot as a table that a radio can go by: by time or by place."""

import io
from typing import Literal

import numpy as np

from faao_mav.errors import InputError
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan


def taken_by(plan: Plan) -> Literal["time", "place"]:
    """Return by what a radio takes a row of the table, which matters when the aircraft is late.

    Without fading, or with precoders for its mean (`radio.fading: none`, `ergodic`), by the nearest
    place: they belong to the line of sight there. With a known draw for each slot
    (`radio.fading: realization`) by time: the draw is the slot's, wherever the aircraft is (2.436
    bit/s/Hz by time, 2.358 by place, on a flight with such draws).
    """
    return "time" if plan.radio.fading == "realization" else "place"


def check_of_slots(solution: Solution) -> None:
    """Raise `InputError` for precoders that know the fading's draw: they are not one per slot."""
    if solution.P_B.ndim != 3 or solution.P_U.ndim != 3:
        raise InputError(
            "precoders that know the draw of the fading (radio.csi: instantaneous) have no table; "
            "use csi: statistical"
        )


def precoder_table(solution: Solution) -> str:
    """Return a CSV text with a row for each slot.

    Columns: `slot`; `t_s`, when it begins on the plan's clock, s; `east_m`, `north_m`,
    `latitude_deg`, `longitude_deg`, where the aircraft then is; in half duplex `receive_share`, the
    share of the slot in which it receives, before it sends; with `radio.rates` `step_B` and
    `step_U`, the numbers of the rates of both hops, 1 the lowest, 0 none; the entries of P_B and
    P_U, row by row, sqrt(W), each as `P_B_1_1_re`, `P_B_1_1_im`; and `taken_by`: `time` where a
    late aircraft takes the row of the time, `place` where that of the nearest place (see
    `taken_by`).

    Raises `InputError` as `check_of_slots` does.
    """
    check_of_slots(solution)
    latitude, longitude = solution.plan.origin.frame.to_geodetic(solution.w)
    names = ["slot", "t_s", "east_m", "north_m", "latitude_deg", "longitude_deg"]
    columns = [np.arange(len(solution.t)), solution.t, *solution.w.T, latitude, longitude]
    if solution.shares is not None:
        names.append("receive_share")
        columns.append(solution.shares)
    if solution.steps is not None:
        names += ["step_B", "step_U"]
        columns += solution.steps
    for name, P in (("P_B", solution.P_B), ("P_U", solution.P_U)):
        rows, entries = P.shape[1:]
        places = [f"{i + 1}_{j + 1}" for i in range(rows) for j in range(entries)]
        names += [f"{name}_{place}_{part}" for place in places for part in ("re", "im")]
        flat = P.reshape(len(P), -1)
        columns += list(np.stack([flat.real, flat.imag], axis=-1).reshape(len(P), -1).T)
    text = io.StringIO()
    formats = ",".join(["%d"] + ["%.12g"] * (len(names) - 1) + [taken_by(solution.plan)])
    header = ",".join([*names, "taken_by"])
    np.savetxt(text, np.stack(columns, axis=1), formats, header=header, comments="")
    return text.getvalue()
