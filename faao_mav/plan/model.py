"""A mission plan: what is flown, where, and over which radio link.

`Plan` is what the rest of the program sees: validated, SI and linear units, frozen. The file
`plan.yaml` with its decibels and degrees is described in `schema`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from faao_mav.plan.autopilots import Autopilot, Kind

Vector: TypeAlias = tuple[float, float]
"""East and north components, metres or m/s."""

Modulation: TypeAlias = Literal["bpsk", "qpsk", "8psk", "16qam", "64qam"]
LineOfSight: TypeAlias = Literal["ula", "all_ones"]
Fading: TypeAlias = Literal["ergodic", "realization", "none"]
ChannelKnowledge: TypeAlias = Literal["statistical", "instantaneous"]
Method: TypeAlias = Literal["direct", "algorithm1"]
PrecoderScheme: TypeAlias = Literal["faao", "mmse", "mrt", "zf", "waterfilling"]
Inputs: TypeAlias = Literal["alphabet", "gaussian"]
Start: TypeAlias = Literal["straight", "bs", "user", "bs-user", "user-bs"]
OnFinish: TypeAlias = Literal["rtl", "land", "hover"]
MissionParameters: TypeAlias = Literal["recommend", "keep"]
StudyScheme: TypeAlias = Literal[
    "faao", "algorithm1", "mmse", "mrt", "zf", "waterfilling", "gaussian"
]
StudyFigure: TypeAlias = Literal["rate", "trajectories"]


@dataclass(frozen=True, slots=True)
class Origin:
    """The point of local (0, 0): WGS84 degrees, metres above mean sea level."""

    latitude: float
    longitude: float
    elevation: float


@dataclass(frozen=True, slots=True)
class Vehicle:
    """The aircraft and its limits: v_max and v_min in m/s, a_max in m/s²."""

    max_speed: float
    max_acceleration: float
    min_speed: float = 0.0
    autopilot: Autopilot = "ardupilot"
    type: Kind = "copter"
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Flight:
    """The flight: w_I, w_F (m, east-north), H (m), T and delta_t (s), end velocities (m/s).

    A velocity of None is free. `slots` is N + 2 = T / delta_t.
    """

    start: Vector
    end: Vector
    altitude: float
    duration: float
    time_step: float
    start_velocity: Vector | None
    end_velocity: Vector | None
    bound_first_acceleration: bool

    @property
    def slots(self) -> int:
        """Number of time slots N + 2."""
        return round(self.duration / self.time_step)


@dataclass(frozen=True, slots=True)
class BaseStation:
    """The base station: p_B (m), N_t, W_B (W)."""

    position: Vector
    antennas: int
    power: float


@dataclass(frozen=True, slots=True)
class Relay:
    """The radio aboard: N_u, W_U (W), sigma_U² (W)."""

    antennas: int
    power: float
    noise: float


@dataclass(frozen=True, slots=True)
class GroundUser:
    """The ground user: p_U (m), N_r, sigma_G² (W)."""

    position: Vector
    antennas: int
    noise: float


@dataclass(frozen=True, slots=True)
class Radio:
    """Both links: rho_0 = `reference_gain` and K = `rician_factor` are linear."""

    base_station: BaseStation
    relay: Relay
    ground_user: GroundUser
    modulation: Modulation
    reference_gain: float
    rician_factor: float
    line_of_sight: LineOfSight
    fading: Fading
    fading_samples: int
    csi: ChannelKnowledge
    seed: int
    causal: bool


@dataclass(frozen=True, slots=True)
class Optimizer:
    """How the plan is optimised; `tolerance` is tol on R_avg, bit/s/Hz.

    `inputs` are those that route and precoders are made for; what is reported is always the rate
    of the alphabet. `starts` are the routes that the direct method starts from.
    """

    method: Method
    precoder: PrecoderScheme
    inputs: Inputs
    starts: tuple[Start, ...]
    tolerance: float
    max_iterations: int


@dataclass(frozen=True, slots=True)
class MissionOptions:
    """How the trajectory becomes a mission; `path_tolerance` in metres."""

    takeoff: bool
    on_finish: OnFinish
    path_tolerance: float
    max_items: int
    parameters: MissionParameters


@dataclass(frozen=True, slots=True)
class Study:
    """What `faao-mission study` makes of a plan: values by dotted key, schemes, seeds, a figure.

    The main job takes no notice of it.
    """

    vary: Mapping[str, tuple[object, ...]]
    schemes: tuple[StudyScheme, ...]
    seeds: int
    figure: StudyFigure


@dataclass(frozen=True, slots=True)
class Plan:
    """A validated plan; `text` is the YAML that it was read from, `source` the name of its file."""

    origin: Origin
    vehicle: Vehicle
    flight: Flight
    radio: Radio
    optimizer: Optimizer
    mission: MissionOptions
    study: Study | None = None
    name: str = ""
    text: str = ""
    source: str = "plan"
