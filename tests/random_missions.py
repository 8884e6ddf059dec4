"""Missions drawn at random, for what holds of any."""

import math

from hypothesis import strategies as st

from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.command import Command
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint

numbers = st.floats(allow_nan=False, allow_infinity=False)
odd = st.sampled_from([0.0, -0.0, math.nan, 1e-320, 1e300, -1e300, -1.0, 1.0, 2.7, 255.5, 65_536.0])
values = odd | st.floats(-200, 200) | numbers | st.just(math.nan)
commands = st.sampled_from([*map(int, Command)]) | st.integers(0, 65_535)
frames = st.sampled_from([0, 2, 3, 5, 6, 10, 11]) | st.integers(0, 255)
latitudes = st.floats(-90, 90) | st.floats(-35.4, -35.3)
longitudes = st.floats(-180, 180) | st.floats(149.1, 149.2)
places = st.tuples(latitudes, longitudes)
points = st.builds(RallyPoint, latitudes, longitudes, numbers)
circles = st.builds(Circle, places, st.floats(1e-3, 1e7), st.booleans())
polygons = st.builds(Polygon, st.lists(places, min_size=3, max_size=6).map(tuple), st.booleans())
fences = st.builds(
    Fence,
    st.lists(polygons, max_size=3).map(tuple),
    st.lists(circles, max_size=3).map(tuple),
    st.none() | points,
)
homes = st.builds(Home, latitudes, longitudes, st.floats(-500, 9000).filter(bool))


@st.composite
def items(draw: st.DrawFn, *, sound: bool) -> MissionItem:
    """Items; `sound` ones are at places, and none jumps."""
    command, frame = draw(commands), draw(frames)
    x, y = (values, values) if frame == 2 or not sound else (latitudes, longitudes)
    if sound and command == Command.DO_JUMP:
        command = int(Command.NAV_WAYPOINT)
    params = draw(st.tuples(values, values, values, values))
    x, y = x | st.just(math.nan), y | st.just(math.nan)
    return MissionItem(command, frame, params, draw(x), draw(y), draw(values), draw(st.booleans()))


@st.composite
def missions(draw: st.DrawFn, *, sound: bool = True) -> Mission:
    """Missions; `sound` ones are at places, and their jumps lead somewhere."""
    flown = draw(st.lists(items(sound=sound), max_size=6 if sound else 12))
    if sound and flown and draw(st.booleans()):
        target = float(draw(st.integers(1, len(flown) + 1)))
        flown.append(MissionItem(177, 2, (target, draw(numbers), 0.0, math.nan)))
    rally = tuple(draw(st.lists(points, max_size=2)))
    return Mission(tuple(flown), draw(st.none() | homes), draw(st.just(Fence()) | fences), rally)
