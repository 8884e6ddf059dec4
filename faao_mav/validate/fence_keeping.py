"""What the vehicle's parameters make of the mission's fence: whether, and how near, it is kept."""

from collections.abc import Iterator

import numpy as np

from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vector import lengths
from faao_mav.vehicle import ARDUCOPTER

RULES = Rules()
_ARDUPILOT = Rules(ARDUCOPTER.family)

_STILL = 0.1
"""The speed, m/s, below which an aircraft heads nowhere. Chosen."""


@RULES.note(
    "fence-not-kept",
    "the vehicle's parameters let it fly on where it leaves the fence",
    "FENCE_ENABLE, FENCE_TYPE, FENCE_ACTION (ArduPilot 4.7); GF_ACTION (PX4 1.16)",
)
def _not_kept(context: ValidationContext) -> Iterator[Issue]:
    response = context.vehicle.type.at_fence(context.vehicle)
    if context.fence is None or response.keeps or not response.parameter:
        return
    value = context.vehicle.value(response.parameter)
    name = context.vehicle.name_of(response.parameter)
    does = "says so, and flies on" if response.action == "report" else "flies on"
    yield Issue(
        None,
        f"a vehicle that leaves the fence {does} ({name} {value:g})",
        f"set {name.partition(',')[0]} to {response.set_to} for the vehicle to turn back",
    )


@_ARDUPILOT.note(
    "ardupilot-fence-margin",
    "the mission comes nearer to the fence than FENCE_MARGIN",
    "measured on ArduCopter 4.7: in AUTO it flies on, at 1 m with FENCE_MARGIN 2 too",
)
def _margin(context: ValidationContext) -> Iterator[Issue]:
    nearest = context.fence.nearest if context.fence else None
    margin = context.vehicle.value("fence_margin")
    if nearest is not None and nearest[0] < margin:
        name = context.vehicle.name_of("fence_margin")
        yield Issue(
            nearest[1],
            f"{nearest[0]:.1f} m from the edge of the fence; {name} is {margin:g} m: in AUTO "
            "ArduPilot flies there all the same, in modes that avoid the fence it does not",
            "keep more room, or set FENCE_MARGIN to less",
        )


@RULES.error(
    "fence-ahead",
    "the vehicle takes a flight towards the fence for one that leaves it",
    "GF_PREDICT: PX4 1.16 GeofenceBreachAvoidance; measured: at 7 m/s it stopped 32 m before",
)
def _ahead(context: ValidationContext) -> Iterator[Issue]:
    vehicle, fence, track = context.vehicle, context.fence, context.track
    if fence is None or track is None or context.track_positions is None:
        return
    velocity, positions = track.velocity[:, :2], context.track_positions[:, :2]
    speed = lengths(velocity)
    ahead = vehicle.type.fence_ahead(vehicle, speed)
    if not ahead.any() or not vehicle.type.at_fence(vehicle).keeps:
        return
    import shapely

    moving = speed > _STILL
    tested = positions[moving] + velocity[moving] * (ahead[moving] / speed[moving])[:, None]
    outside = np.zeros(len(speed), dtype=bool)
    outside[moving] = fence.broken(shapely.points(tested)).any
    for index in np.unique(track.item[outside]).tolist():
        first = int(np.flatnonzero(outside & (track.item == index))[0])
        yield Issue(
            index,
            f"at {track.t[first]:.0f} s the flight is at {speed[first]:.1f} m/s, and "
            f"{ahead[first]:.0f} m straight on it were outside the fence: the vehicle "
            "breaks off the mission there",
            "set GF_PREDICT to 0, or fly slower there and keep more room",
        )


RULES += _ARDUPILOT
