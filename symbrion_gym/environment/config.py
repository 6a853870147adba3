"""The options of the environment, checked in one place."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reconstruction.deprecation import accept_former_fields
from reconstruction.range_checks import check_choice, check_not_negative, check_positive
from symbrion_gym.arenas.checks import FRICTION_LIMITS
from symbrion_gym.assets import NAMED_ARENAS
from symbrion_gym.errors import OptionError, OrganismError

if TYPE_CHECKING:
    from symbrion_gym.arenas.arena import Arena
    from symbrion_gym.robot.organism import Organism
    from symbrion_gym.robot.sensor_noise import SensorNoise
    from symbrion_gym.tasks.features.gap import GapSearch
    from symbrion_gym.tasks.route import Point, RouteMargins, StartName
    from symbrion_gym.tasks.success_check import SuccessCriteria

SENSORS = (
    "hinge_angle",
    "hinge_rate",
    "pitch",
    "roll",
    "acceleration",
    "ir",
    "contact",
    "previous_action",
    "hinge_target",
    "dock_force",
    "odometry",
    "track_odometry",
    "laser",
)
DEFAULT_SENSORS = SENSORS[:8]
STARTS = ("floor", "pit")
TRACK_CONTROLS = ("constant", "body", "modules")
RANDOM_LIMITS = {
    "friction": FRICTION_LIMITS,
    "torque_scale": (1e-3, 10.0),
    "start_offset": (-5.0, 5.0),
    "start_lateral": (-5.0, 5.0),
    "yaw": (-np.pi, np.pi),
    "track_speed": (0.0, 2.0),
}
"""Smallest and largest value of what may differ from episode to episode; units as in `Domain`."""
RANDOM_OPTIONS = tuple(RANDOM_LIMITS)
MAX_MODULES = 50
"""More than any organism in use; the time of a step grows faster than their number."""
MAX_TIMESTEP = 0.02
"""Contacts are not resolved by longer physics steps [s]."""
RENAMED_OPTIONS = {"randomise": "randomize", "abyss": "bottomless"}
"""Old name -> new name of options; the old ones are deprecated."""
_NOT_NEGATIVE = (
    "track_speed",
    "noise",
    "forward_weight",
    "success_bonus",
    "effort_weight",
    "stuck_progress",
)
_POSITIVE = ("stretch", "hinge_torque", "timestep", "duration", "stuck_time")


@accept_former_fields(abyss="bottomless")
@dataclass(frozen=True)
class SnakePitConfig:
    """What an environment is made of.

    Attributes:
        arena: a name, a folder, a mesh file or an `Arena`.
        modules: length of the snake, or an `Organism`.
        pit: width of the pit of the named courses [m]; None for `default_pit`.
        default_pit: width of the pit that a registered id sets [m]; None for the arena's own.
        default_ends: start and goal, (x, y) [m], that a registered id sets for its own, named arena, where neither
            is given.
        stretch: factor on all lengths along x, to simulate errors of a scan.
        friction: sliding friction of tracks and bodies on everything; None for the arena's own.
        track_speed: surface speed of the tracks [m/s]; estimates range from 0.06 to 0.15.
        hinge_torque: largest torque of the hinges [N m]; estimates range from 4 to 5.
        sensors: parts of the observation, in order, of `SENSORS`.
        start: "floor": before the ramp or step; "pit": before the pit; or (x, y) or (x, y, z)
            [m], where z selects one of several storeys.
        goal: (x, y) or (x, y, z) that the head has to reach [m]; None for the far side of the course or the pit.
        noise: factor on the sensor noise: 0 for none, 1 as estimated for the real robot.
        bottomless: whether touching the floor of the pit ends the episode, as if the pit had none.
        track_control: "constant", or track speeds are part of the action: "body" one, "modules" one each.
        tracks: how tracks are modeled; see `ScoutConfig`.
        timestep: physics step [s].
        frame_skip: physics steps in a control step (tick).
        duration: an episode is truncated after this [s].
        stuck_time: time without progress after which it is truncated as well [s].
        forward_weight: reward per meter of progress.
        success_bonus: reward of a success.
        effort_weight: cost per joule of the hinges' work.
        timers: whether `info` contains the times of MuJoCo's timers.
        randomize: reset options for every episode: name -> a number, or a pair (low, high) to draw from.
        stuck_progress: smallest progress that counts as such, for `stuck_time` [m].
        criteria: limits of a success; None for the defaults of `SuccessCriteria`.
        margins: distances of the route from ramp, pit and rim; None for the defaults of `RouteMargins`.
        pit_search: what counts as a pit on a surface; None for the defaults of `GapSearch`.
        sensor_noise: standard deviations at `noise` 1; None for the defaults of `SensorNoise`.

    Raises:
        OptionError: an option is out of range; the message names option, value and what is allowed.
        OrganismError: an impossible number of modules.
    """

    arena: str | Path | Arena = "truth"
    modules: int | Organism = 8
    pit: float | None = None
    default_pit: float | None = None
    default_ends: tuple[tuple[float, float], tuple[float, float]] | None = None
    stretch: float = 1.0
    friction: float | None = None
    track_speed: float = 0.10
    hinge_torque: float = 4.5
    sensors: tuple[str, ...] = DEFAULT_SENSORS
    start: StartName | Point = "floor"
    goal: Point | None = None
    noise: float = 0.0
    bottomless: bool = False
    track_control: str = "constant"
    tracks: str = "spheres"
    timestep: float = 0.005
    frame_skip: int = 4
    duration: float = 90.0
    stuck_time: float = 15.0
    forward_weight: float = 1.0
    success_bonus: float = 1.0
    effort_weight: float = 0.002
    timers: bool = False
    randomize: Mapping[str, Any] = field(default_factory=dict)
    stuck_progress: float = 0.02
    criteria: SuccessCriteria | None = None
    margins: RouteMargins | None = None
    pit_search: GapSearch | None = None
    sensor_noise: SensorNoise | None = None

    def __post_init__(self) -> None:
        check_not_negative(self, _NOT_NEGATIVE, OptionError)
        check_positive(self, _POSITIVE, OptionError)
        check_not_negative(self, self._find_given("pit", "default_pit"), OptionError)
        check_positive(self, self._find_given("friction"), OptionError)
        if isinstance(self.modules, bool) or (
            isinstance(self.modules, int | np.integer) and not 1 <= self.modules <= MAX_MODULES
        ):
            raise OrganismError(f"modules must be 1 to {MAX_MODULES}, or an Organism, got {self.modules!r}")
        if (
            isinstance(self.frame_skip, bool)
            or int(self.frame_skip) != self.frame_skip
            or self.frame_skip < 1
        ):
            raise OptionError(f"frame_skip must be a whole number above 0, got {self.frame_skip!r}")
        if self.timestep > MAX_TIMESTEP:
            raise OptionError(f"timestep must be at most {MAX_TIMESTEP} s, got {self.timestep}")
        check_choice("track_control", self.track_control, TRACK_CONTROLS, OptionError)
        if isinstance(self.start, str):
            check_choice("start", self.start, STARTS, OptionError)
        if isinstance(self.sensors, str) or not isinstance(self.sensors, Iterable):
            raise OptionError(f"sensors must be a sequence of names, got {self.sensors!r}")
        for name in self.sensors:
            check_choice("sensors", name, SENSORS, OptionError)
        object.__setattr__(self, "sensors", tuple(dict.fromkeys(self.sensors)))
        for name in self.randomize:
            check_choice("randomize", name, RANDOM_OPTIONS, OptionError)

    @classmethod
    def from_options(cls, options: Mapping[str, Any]) -> SnakePitConfig:
        """Return the configuration of keyword arguments.

        Raises:
            OptionError: an option that does not exist, is given under two names, or is out of range.
            OrganismError: an impossible number of modules.
        """
        given = dict(options)
        for old, new in RENAMED_OPTIONS.items():
            if old in given and new in given:
                raise OptionError(f"the options {old!r} and {new!r} are the same; give {new!r} alone")
            if old in given:
                warnings.warn(f"option {old!r} is now called {new!r}", DeprecationWarning, stacklevel=3)
                given[new] = given.pop(old)
        names = [entry.name for entry in fields(cls)]
        for name in given:
            check_choice("option", name, names, OptionError)
        return cls(**given)

    def _find_given(self, *names: str) -> list[str]:
        """Return those of some options that are not None."""
        return [name for name in names if getattr(self, name) is not None]

    def find_ends(self) -> tuple[Any, Any]:
        """Return start and goal: those given, else those of the registered id in its own arena."""
        is_named = isinstance(self.arena, str) and self.arena in NAMED_ARENAS
        if self.default_ends is None or not is_named or self.start != "floor" or self.goal is not None:
            return self.start, self.goal
        return self.default_ends

    @property
    def dt(self) -> float:
        """Length of a control tick [s]."""
        return self.timestep * self.frame_skip
