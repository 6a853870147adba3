"""The options of the environment, checked in one place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.progress import Progress
from reconstruction._src.base.range_checks import (
    as_floats,
    check_choice,
    check_counts,
    check_not_negative,
    check_positive,
)
from symbrion_gym._src.arenas.checks import FRICTION_LIMITS
from symbrion_gym._src.errors import OptionError, OrganismError
from symbrion_gym._src.robot.scout_constants import DEFAULT_SENSORS, SCOUT_LIMITS, SENSORS, ScoutConfig

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.organism import Organism
    from symbrion_gym._src.robot.scout_constants import SensorNoise
    from symbrion_gym._src.tasks.recorders import Recorder
    from symbrion_gym._src.tasks.route import Point, StartName
    from symbrion_gym._src.tasks.task import Task
    from symbrion_gym._src.tasks.terms import Sensor

SCOUT_OPTIONS = tuple(SCOUT_LIMITS)
"""Options that are constants of the modules too."""
_DEFAULTS = {entry.name: entry.default for entry in fields(ScoutConfig)}


def read_random_range(name: str, value: Any) -> Float[np.ndarray, " n"]:
    """Return the one value, or the lowest and highest, that a reset option has or is drawn from."""
    low, high = RANDOM_LIMITS[name]
    try:
        bounds = np.asarray(value, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        bounds = np.zeros(0)
    if len(bounds) not in (1, 2) or not (
        np.isfinite(bounds).all() and low <= bounds.min() and bounds.max() <= high
    ):
        raise OptionError(
            f"{name} must be a number or a pair (low, high) within {low:g} to {high:g}, got {value!r}"
        )
    if bounds[0] > bounds[-1]:
        raise OptionError(f"{name}: the range {value!r} is upside down")
    return bounds


def check_count(name: str, value: Any) -> int:
    """Return a number of things, which is a whole number above 0."""
    if not isinstance(value, Integral) or value < 1:
        raise OptionError(f"{name} must be a whole number above 0, got {value!r}")
    return int(value)


def check_organism_options(given: Mapping[str, Any]) -> None:
    """Refuse options that contradict each other."""
    if given.get("modules") is not None and given.get("organism") is not None:
        raise OptionError("the options 'modules' and 'organism' both name the body; give one of them")
    for body in (given.get("modules"), given.get("organism")):
        if body is not None and hasattr(body, "scout"):  # an `Organism`, whose module takes long to load
            wanted = {name: given[name] for name in SCOUT_OPTIONS if given.get(name) is not None}
            apply_options(cast("Organism", body), wanted)


def apply_options(organism: Organism, wanted: Mapping[str, Any]) -> Organism:
    """Return an organism whose modules have the constants that options name."""
    scout = organism.scout
    for name, value in wanted.items():
        own = getattr(scout, name)
        if own not in (_DEFAULTS[name], value):
            raise OptionError(
                f"{name}={value!r} contradicts {name}={own!r} of the organism's modules; give one of them"
            )
    return replace(organism, scout=replace(scout, **wanted)) if wanted else organism


_OF_TASK = ("terminations", "rewards")
STARTS = ("floor", "pit")
TRACK_CONTROLS = ("constant", "body", "modules", "skid")


def count_tracks(track_control: str, num_modules: int) -> int:
    """Return the number of track speeds in an action under the option `track_control`."""
    return (0, 1, num_modules, 2 * num_modules)[TRACK_CONTROLS.index(track_control)]


RANDOM_LIMITS = {
    "friction": FRICTION_LIMITS,
    "torque_scale": (1e-3, 10.0),
    "start_offset": (-5.0, 5.0),
    "start_lateral": (-5.0, 5.0),
    "yaw": (-np.pi, np.pi),
    "track_speed": SCOUT_LIMITS["track_speed"],
    "patch_friction": (-1.0, 1.0),
}
"""Smallest and largest value of what may differ from episode to episode; units as in `Domain`."""
RANDOM_OPTIONS = tuple(RANDOM_LIMITS)
MAX_MODULES = 50  # More than any organism in use; the time of a step grows faster than their number
MAX_TIMESTEP = 0.02  # Contacts are not resolved by longer physics steps [s]
MIN_TIMESTEP = 1e-4  # Shorter physics steps tell nothing more [s]
MAX_STEPS = 10_000_000  # Most physics steps of an episode: 14 hours of the usual 5 ms
MAX_TICK = 1.0  # Longest control tick [s]
_INTERNAL = "default_"  # Options of this prefix are for registered ids; messages do not list them
_NOT_NEGATIVE = (
    *("noise", "pit", "default_pit"),
    *("forward_weight", "success_bonus", "effort_weight", "stuck_progress"),
)
_POSITIVE = ("stretch", "timestep", "duration", "stuck_time")


@dataclass(frozen=True)
class EnvironmentConfig:
    """What an environment is made of."""

    # What each means stands in the docstring of `OrganismEnv`; `default_*` is what a registered id sets.
    arena: str | Path | Arena = "truth"
    modules: int | Organism = 8
    pit: float | None = None
    default_pit: float | None = None
    course: Mapping[str, Any] = field(default_factory=dict)
    default_course: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    progress: Progress | None = None
    stretch: float = 1.0
    friction: float | None = None
    track_speed: float = 0.10  # estimates range from 0.06 to 0.15
    hinge_torque: float = 4.5  # estimates range from 4 to 5
    sensors: tuple[str | Sensor, ...] = DEFAULT_SENSORS
    noise: float = 0.0
    track_control: str = "constant"
    timestep: float = 0.005
    frame_skip: int = 4
    timers: bool = False
    randomize: Mapping[str, Any] = field(default_factory=dict)
    sensor_noise: SensorNoise | None = None
    task: Task | str | None = None
    task_parameters: Mapping[str, Any] = field(default_factory=dict)
    recorders: tuple[Recorder, ...] = ()
    default_task: str = "snake_pit"
    default_parameters: Mapping[str, Any] = field(default_factory=dict)
    start: StartName | Point | None = None  # a parameter of the task, as all up to `organism`
    goal: Point | None = None
    bottomless: bool | None = None
    duration: float | None = None
    stuck_time: float | None = None
    stuck_progress: float | None = None
    forward_weight: float | None = None
    success_bonus: float | None = None
    effort_weight: float | None = None
    organism: int | str | Path | Organism | None = None

    def __post_init__(self) -> None:
        check_not_negative(self, filter(self._needs_number, _NOT_NEGATIVE), OptionError)
        check_positive(self, filter(self._needs_number, _POSITIVE), OptionError)
        for name in filter(self._needs_number, SCOUT_OPTIONS):
            as_floats(name, [getattr(self, name)], *SCOUT_LIMITS[name], OptionError)
        check_counts(self, ("frame_skip",), OptionError)
        if isinstance(self.modules, bool) or (
            isinstance(self.modules, int | np.integer) and not 1 <= self.modules <= MAX_MODULES
        ):
            raise OrganismError(f"modules must be 1 to {MAX_MODULES}, or an Organism, got {self.modules!r}")
        if self.organism is not None and self.modules != type(self).modules:
            check_organism_options({"modules": self.modules, "organism": self.organism})
        if self.timestep > MAX_TIMESTEP:
            raise OptionError(f"timestep must be at most {MAX_TIMESTEP} s, got {self.timestep}")
        if self.timestep < MIN_TIMESTEP:
            raise OptionError(f"timestep must be at least {MIN_TIMESTEP} s, got {self.timestep}")
        if self.duration is not None:
            self._check_duration(self.duration)
        if self.timestep * self.frame_skip > MAX_TICK:
            raise OptionError(
                f"timestep x frame_skip is {self.timestep * self.frame_skip:g} s; at most {MAX_TICK:g} s are possible"
            )
        check_choice("track_control", self.track_control, TRACK_CONTROLS, OptionError)
        if isinstance(self.start, str):
            check_choice("start", self.start, STARTS, OptionError)
        if isinstance(self.sensors, str) or not isinstance(self.sensors, Iterable):
            raise OptionError(f"sensors must be a sequence of names, got {self.sensors!r}")
        object.__setattr__(self, "sensors", tuple(dict.fromkeys(map(_read_sensor, self.sensors))))
        if not self.sensors:
            raise OptionError(f"sensors is empty; give at least one of {', '.join(SENSORS)}")
        if len(set(self.sensor_names)) < len(self.sensors):
            raise OptionError(f"two sensors have one name in {self.sensor_names}")
        if self.recorders:
            from symbrion_gym._src.tasks.recorders import check_recorders

            object.__setattr__(self, "recorders", check_recorders(self.recorders))
        if not isinstance(self.course, Mapping):
            raise OptionError(
                f"course is {self.course!r}; sizes by name are needed, as {{'pit': 0.5}}; for a Course give "
                "arena=Arena.from_course(course)"
            )
        for name, value in self.randomize.items():
            check_choice("randomize", name, RANDOM_OPTIONS, OptionError)
            read_random_range(name, value)

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """Names of the parts of an observation, in their order."""
        return tuple(each if isinstance(each, str) else each.name for each in self.sensors)

    @classmethod
    def from_options(cls, options: Mapping[str, Any], others: Iterable[str] = ()) -> EnvironmentConfig:
        """Return the configuration of keyword arguments: fields, parameters of a named task, and what a registered id
        sets: `default_organism`, where neither `modules` nor `organism` is given, and `default_arena`. A message about
        an unknown name lists others, too.
        """
        given = dict(options)
        if "arenas" in given:
            raise OptionError("arenas=[...] needs gym.make_vec(id, vectorization_mode='vector_entry_point')")
        if "default_arena" in given:
            given.setdefault("arena", given.pop("default_arena"))
        usual_body = given.pop("default_organism", None)
        if usual_body is not None and given.get("modules") is None and given.get("organism") is None:
            given["organism"] = usual_body
        own = cls.check_names(given, others, "option", OptionError)
        parameters = {name: given.pop(name) for name in own}
        check_organism_options(given)
        if parameters:
            given["task_parameters"] = {**given.get("task_parameters", {}), **parameters}
        return cls(**given)

    @classmethod
    def check_names(
        cls, given: Mapping[str, Any], others: Iterable[str], what: str, error: type[Exception]
    ) -> list[str]:
        """Refuse unknown names, and list the possible ones after others; return those of parameters of the task."""
        unknown = [name for name in given if name not in _NAMES]
        own = cls._find_parameters(given) if unknown else ()
        for name in set(unknown).difference(own):
            if name in _OF_TASK:
                raise error(f"{what}: {name!r} is a field of `symbrion_gym.Task`; give task=Task(...)")
            listed = [*others, *(each for each in _NAMES if not each.startswith(_INTERNAL)), *own]
            check_choice(what, name, listed, error)
        return unknown

    @classmethod
    def _find_parameters(cls, given: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the names of the parameters of the task that options name; none for a ready `Task`."""
        from symbrion_gym._src.tasks.catalog import find_parameters

        chosen = given.get("task") or given.get("default_task", cls.default_task)
        return find_parameters(chosen) if isinstance(chosen, str) else ()

    def _needs_number(self, name: str) -> bool:
        """Return whether an option must be a number: it is given, or None means nothing."""
        return getattr(self, name) is not None or getattr(type(self), name) is not None

    def find_task(self) -> Task:
        """Return the task, with the parameters that are given."""
        from symbrion_gym._src.tasks.catalog import choose_task

        given = {name: value for name in TASK_OPTIONS if (value := getattr(self, name)) is not None}
        defaults = {} if self.task is not None else self.default_parameters
        task = choose_task(self.task or self.default_task, {**defaults, **given, **self.task_parameters})
        self._check_duration(task.duration)
        return task

    def _check_duration(self, duration: float) -> None:
        """Refuse an episode that would never end."""
        if duration > MAX_STEPS * self.timestep:
            raise OptionError(
                f"duration must be at most {MAX_STEPS * self.timestep:g} s at a timestep of {self.timestep} s, "
                f"got {duration}"
            )

    @property
    def dt(self) -> float:
        """Length of a control tick [s]."""
        return self.timestep * self.frame_skip


def _read_sensor(given: Any) -> str | Sensor:
    """Return the name of a sensor, or one of a user's own: any object with what a `Sensor` has."""
    if isinstance(given, str) or not hasattr(given, "function"):
        check_choice("sensors", given, SENSORS, OptionError)
        return given
    from symbrion_gym._src.tasks.terms import Sensor

    return Sensor(*(getattr(given, each.name) for each in fields(Sensor)))


_NAMES = [entry.name for entry in fields(EnvironmentConfig)]
TASK_OPTIONS = tuple(_NAMES[_NAMES.index("start") : _NAMES.index("organism")])
"""Options that are parameters of the task; None is the task's own value."""
