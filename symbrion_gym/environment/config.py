"""The options of the environment, checked in one place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from symbrion_gym.arenas.checks import FRICTION_LIMITS
from symbrion_gym.errors import OrganismError

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


@dataclass(frozen=True)
class SnakePitConfig:
    """What an environment is made of; `SnakePitEnv` explains each.

    Raises:
        ValueError: an option is out of range; the message names option, value and what is allowed.
        OrganismError: an impossible body.
        ArenaError: an impossible arena.
    """

    arena: Any = "truth"
    modules: Any = 8
    pit: float | None = None
    default_pit: float | None = None
    stretch: float = 1.0
    friction: float | None = None
    track_speed: float = 0.10
    hinge_torque: float = 4.5
    sensors: tuple[str, ...] = DEFAULT_SENSORS
    start: Any = "floor"
    goal: Any = None
    noise: float = 0.0
    abyss: bool = False
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
    randomise: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("track_speed", "noise", "forward_weight", "success_bonus", "effort_weight"):
            _check(self, name, 0.0, True)
        for name in ("stretch", "hinge_torque", "timestep", "duration", "stuck_time"):
            _check(self, name, 0.0, False)
        for name in ("pit", "default_pit", "friction"):
            if getattr(self, name) is not None:
                _check(self, name, 0.0, name != "friction")
        if isinstance(self.modules, bool) or (
            isinstance(self.modules, int | np.integer) and not 1 <= self.modules <= 50
        ):
            raise OrganismError(f"modules must be 1 to 50, or an Organism, got {self.modules!r}")
        if (
            isinstance(self.frame_skip, bool)
            or int(self.frame_skip) != self.frame_skip
            or self.frame_skip < 1
        ):
            raise ValueError(f"frame_skip must be a whole number above 0, got {self.frame_skip!r}")
        if self.timestep > 0.02:
            raise ValueError(f"timestep must be at most 0.02 s, got {self.timestep}")
        _check_choice("track_control", self.track_control, TRACK_CONTROLS)
        if isinstance(self.start, str):
            _check_choice("start", self.start, STARTS)
        if isinstance(self.sensors, str) or not isinstance(self.sensors, Iterable):
            raise ValueError(f"sensors must be a sequence of names, got {self.sensors!r}")
        for name in self.sensors:
            _check_choice("sensors", name, SENSORS)
        object.__setattr__(self, "sensors", tuple(dict.fromkeys(self.sensors)))
        for name in self.randomise:
            _check_choice("randomise", name, RANDOM_OPTIONS)

    @classmethod
    def from_options(cls, options: Mapping[str, Any]) -> SnakePitConfig:
        """Return the configuration of keyword arguments.

        Raises:
            ValueError: an option that does not exist.
        """
        names = [entry.name for entry in fields(cls)]
        for name in options:
            _check_choice("option", name, names)
        return cls(**options)

    @property
    def dt(self) -> float:
        """Length of a control tick [s]."""
        return self.timestep * self.frame_skip


def _check(config: SnakePitConfig, name: str, low: float, is_low_allowed: bool) -> None:
    value = getattr(config, name)
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a number, got {value!r}") from None
    if not (low <= number if is_low_allowed else low < number) or not number < np.inf:
        raise ValueError(f"{name} must be {'at least' if is_low_allowed else 'above'} {low:g}, got {value}")


def _check_choice(what: str, value: Any, choices: Any) -> None:
    if value not in choices:
        raise ValueError(f"{what}: there is no {value!r}; there are: {', '.join(map(str, choices))}")
