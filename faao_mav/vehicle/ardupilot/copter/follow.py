"""How the aircraft follows its target, and how the target waits for the aircraft."""

import math
from array import array
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.plan import Vector
from faao_mav.vehicle.ardupilot.copter.course import GRID, Course, Stop, TargetRow
from faao_mav.vehicle.ardupilot.copter.parameters import ArduCopterLimits

_MARGIN = 0.05
"""The share by which an aircraft may be slower than its target before the target's clock waits for
it. The autopilot's own."""

_STANDING = 1e-5
"""The sum of an aircraft's speed and its error, m/s, and acceleration, m/s², below which it stands
until a hold is over. Chosen: ten times more changed arrivals by up to 0.1 s after a leg at 0.13
m/s."""

_HEADED = 0.5
"""The speed of the target, m/s, above which the aircraft's nose is along the target's way. Chosen;
what a change costs is not measured."""

_NONE = (math.inf, 0.0)
"""After the last commanded speed: when there is another one."""


@dataclass(frozen=True, slots=True, eq=False)
class Pursuit:
    """The flight at the times `t` (k,), s, every `GRID` seconds from 0.

    `clock` (k,), s, is the target's time and `rate` (k,) how fast it runs; `position` and
    `velocity` (k, 2) are the aircraft's, m and m/s east and north. `arrivals` (stops,), s, are
    when the target came to the stops.
    """

    t: Real
    clock: Real
    rate: Real
    position: Real
    velocity: Real
    arrivals: Real


def pursue(
    course: Course,
    table: Iterator[TargetRow],
    limits: ArduCopterLimits,
    *,
    wind: Vector = (0.0, 0.0),
    longest: float = math.inf,
) -> Pursuit:
    """Return the flight along `course`, given as rows, up to the end of its last hold.

    Raises `InputError` for one that takes more than `longest` s, as in wind that carries it away.

    The target's clock runs at a rate s <= 1 with the time constant A/J: towards the
    aircraft's speed along the target's, less the position error times its gain, over the target's
    speed, plus a margin. The aircraft is asked for the target's acceleration plus what the errors
    call for, up to the lean limit, where the integral stands still. The air, which moves
    at `wind`, m/s, drags at it along its nose and across, each as k v + q v |v|. (Measured in the
    simulator: with the lean limit at 10.3 m/s the air comes from ahead, at 10.8 and 11.0 m/s 21 and
    25 degrees from there.) It begins in a hover, nose to the north, held against the wind by the
    integral. The nose points where the target moves to, in a hover where it did before.
    """
    kp, kv, ki = limits.position_gain, limits.velocity_gain, limits.velocity_integral
    body, lean = limits.body, limits.lean
    linear, quadratic = body.linear_drag, body.quadratic_drag
    patience = limits.acceleration / limits.jerk
    leaning, adapting = 1 - math.exp(-GRID / body.lag), 1 - math.exp(-GRID / patience)
    hypot, sqrt, most = math.hypot, math.sqrt, lean * lean
    commands = iter([*zip(course.passed[:-1].tolist(), course.speeds, strict=True), _NONE])
    farthest, (told, speed) = math.inf, next(commands)
    last = math.ceil(course.end / GRID)
    stops = iter(course.stops)
    stop: Stop | None = next(stops, None)
    end = stop.time if stop else 0.0
    arrivals: list[float] = []
    clock, resume, s = 0.0, course.wait, 1.0
    x, dx, y, dy, u, du, v, dv, c, dc, b, db, d, dd = next(table)
    at, px, py = 0, x, y
    east, north = wind
    nx, ny, vx, vy = 0.0, 1.0, 0.0, 0.0
    ax = -east * (linear + quadratic * abs(east))
    ay = -north * (linear + quadratic * abs(north))
    ix, iy = ax, ay
    log = array("d", (clock, s, px, py, vx, vy))
    count, now = 0, 0.0
    while stop is not None or now < resume:
        if now > longest:
            raise InputError(
                f"the flight would take more than {longest:.0f} s, perhaps for the wind"
            )
        # where the target is at the beginning of this step, and how fast its clock runs
        w = clock / GRID
        k = int(w)
        if k > last:
            k = last
        w -= k
        while at < k:
            x, dx, y, dy, u, du, v, dv, c, dc, b, db, d, dd = next(table)
            at += 1
        while clock >= told:
            farthest, (told, speed) = limits.farthest(speed) ** 2, next(commands)
        ex, ey = x + w * dx - px, y + w * dy - py
        if (apart := ex * ex + ey * ey) > farthest:
            share = sqrt(farthest / apart)
            ex, ey = share * ex, share * ey
        if now < resume:  # at rest, though samples on both sides are not
            ux = uy = fx = fy = 0.0
            aim = 1.0
        else:
            ux, uy = u + w * du, v + w * dv
            fx, fy = b + w * db, d + w * dd
            square = ux * ux + uy * uy + c + w * dc
            aim = 1.0
            if square > 1e-9:
                aim = _MARGIN + ((vx - kp * ex) * ux + (vy - kp * ey) * uy + c + w * dc) / square
                aim = 1.0 if aim > 1.0 else 0.0 if aim < 0.0 else aim
        s += (aim - s) * adapting

        # what the controller asks for, and what the aircraft makes of it
        gx, gy = ux + kp * ex - vx, uy + kp * ey - vy
        fx, fy = fx + kv * gx + ix, fy + kv * gy + iy
        jx, jy = ix + ki * gx * GRID, iy + ki * gy * GRID
        if fx * fx + fy * fy > most:
            if gx * fx + gy * fy > 0 and (grown := hypot(jx, jy)) > 0:
                kept = min(1.0, hypot(ix, iy) / grown)
                jx, jy = kept * jx, kept * jy
            fx, fy = _leaning_most(fx, fy, ux, uy, lean)
        ix, iy = jx, jy
        ax += (fx - ax) * leaning
        ay += (fy - ay) * leaning
        headed = sqrt(ux * ux + uy * uy)
        if headed > _HEADED:
            nx, ny = ux / headed, uy / headed
        rx, ry = vx - east, vy - north
        along, across = nx * rx + ny * ry, nx * ry - ny * rx
        along *= linear + quadratic * abs(along)
        across *= linear + quadratic * abs(across)
        hx, hy = (ax - nx * along + ny * across) * GRID, (ay - ny * along - nx * across) * GRID
        px += (vx + hx / 2) * GRID
        py += (vy + hy / 2) * GRID
        vx += hx
        vy += hy

        # the clock goes on, unless it stands at a stop for a part of this step or all of it
        began, count = now, count + 1
        now = GRID * count
        ahead = clock + s * GRID
        if resume <= began and ahead < end:
            clock = ahead
        else:
            free = began if began > resume else resume
            while stop is not None and free < now:
                ahead = clock + s * (now - free)
                if ahead < end:
                    clock = ahead
                    break
                arrivals.append(free + (end - clock) / s if s > 0 else free)
                clock, resume = end, arrivals[-1] + stop.wait
                free, stop = resume, next(stops, None)
                end = stop.time if stop else end
        log.extend((clock, s, px, py, vx, vy))
        if now < resume and hypot(vx, vy) + hypot(gx, gy) + hypot(hx, hy) / GRID < _STANDING:
            idle = int((resume - now) / GRID)
            log.extend(log[-6:] * idle)
            count += idle
            now = GRID * count
    flight = np.frombuffer(log).reshape(-1, 6)
    return Pursuit(
        t=GRID * np.arange(len(flight), dtype=float),
        clock=flight[:, 0],
        rate=flight[:, 1],
        position=flight[:, 2:4],
        velocity=flight[:, 4:],
        arrivals=np.array(arrivals),
    )


def _leaning_most(fx: float, fy: float, ux: float, uy: float, lean: float) -> tuple[float, float]:
    """Return (fx, fy), m/s², cut to `lean`: what is across the way (ux, uy) comes first."""
    speed = math.hypot(ux, uy)
    if speed < 1e-6:
        size = math.hypot(fx, fy)
        return fx * lean / size, fy * lean / size
    ux, uy = ux / speed, uy / speed
    along, across = fx * ux + fy * uy, fy * ux - fx * uy
    across = min(lean, max(-lean, across))
    most = math.sqrt(lean * lean - across * across)
    along = min(most, max(-most, along))
    return along * ux - across * uy, along * uy + across * ux
