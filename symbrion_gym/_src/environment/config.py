"""The options of the environment, checked in one place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from reconstruction._src.base.progress import Progress
from reconstruction._src.base.range_checks import check_choice, check_not_negative, check_positive
from symbrion_gym._src.arenas.checks import FRICTION_LIMITS
from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.errors import OptionError, OrganismError
from symbrion_gym._src.robot.scout_constants import DEFAULT_SENSORS, SENSORS, ScoutConfig

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.organism import Organism
    from symbrion_gym._src.robot.scout_constants import SensorNoise
    from symbrion_gym._src.tasks.features.gap import GapSearch
    from symbrion_gym._src.tasks.recorders import Recorder
    from symbrion_gym._src.tasks.route import Point, RouteMargins, StartName, SuccessCriteria
    from symbrion_gym._src.tasks.task import Task

SCOUT_OPTIONS = ("hinge_torque", "track_speed", "tracks", "friction")
"""Options that are constants of the modules too."""
_DEFAULTS = {entry.name: entry.default for entry in fields(ScoutConfig)}


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


STARTS = ("floor", "pit")
CONTACTS = ("pyramidal", "elliptic")
TRACK_CONTROLS = ("constant", "body", "modules", "skid")
RANDOM_LIMITS = {
    "friction": FRICTION_LIMITS,
    "torque_scale": (1e-3, 10.0),
    "start_offset": (-5.0, 5.0),
    "start_lateral": (-5.0, 5.0),
    "yaw": (-np.pi, np.pi),
    "track_speed": (0.0, 2.0),
    "roll": (-np.pi, np.pi),
    "patch_friction": (-1.0, 1.0),
}
"""Smallest and largest value of what may differ from episode to episode; units as in `Domain`."""
RANDOM_OPTIONS = tuple(RANDOM_LIMITS)
MAX_MODULES = 50  # More than any organism in use; the time of a step grows faster than their number
MAX_TIMESTEP = 0.02  # Contacts are not resolved by longer physics steps [s]
TASK_OPTIONS = (
    "start",
    "goal",
    "bottomless",
    "duration",
    "stuck_time",
    "stuck_progress",
    "forward_weight",
    "success_bonus",
    "effort_weight",
    "criteria",
    "margins",
    "pit_search",
)
"""Options that are parameters of the task; None is the task's own value."""
_INTERNAL = "default_"  # Options of this prefix are for registered ids; messages do not list them
_NOT_NEGATIVE = ("track_speed", "noise")
_POSITIVE = ("stretch", "hinge_torque", "timestep")
_NOT_NEGATIVE_IF_GIVEN = (
    "pit",
    "default_pit",
    "forward_weight",
    "success_bonus",
    "effort_weight",
    "stuck_progress",
)
_POSITIVE_IF_GIVEN = ("friction", "duration", "stuck_time")


@dataclass(frozen=True)
class EnvironmentConfig:
    """What an environment is made of.

    Raises:
        OptionError: an option is out of range; the message names option, value and what is allowed.
        OrganismError: an impossible number of modules.
    """

    arena: str | Path | Arena = "truth"  # a name, a folder, a mesh file or an `Arena`
    modules: int | Organism = 8  # length of the snake, or an `Organism`
    pit: float | None = None  # width of the pit of the named courses [m]; None for `default_pit`
    # width of the pit that a registered id sets [m]; None for the arena's own
    default_pit: float | None = None
    # start and goal, (x, y) [m], that a registered id sets for its own, named arena, where neither is given
    default_ends: tuple[tuple[float, float], tuple[float, float]] | None = None
    # sizes of an arena made in code, fields of `Course` or `StairsCourse`
    course: Mapping[str, Any] = field(default_factory=dict)
    # name of an arena made in code -> sizes that a registered id sets
    default_course: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    progress: Progress | None = None  # called while a surface in a file is made an arena; None to log it
    stretch: float = 1.0  # factor on all lengths along x, to simulate errors of a scan
    # sliding friction of tracks and bodies on everything; None for the arena's own
    friction: float | None = None
    track_speed: float = 0.10  # surface speed of the tracks [m/s]; estimates range from 0.06 to 0.15
    hinge_torque: float = 4.5  # largest torque of the hinges [N m]; estimates range from 4 to 5
    sensors: tuple[str, ...] = DEFAULT_SENSORS  # parts of the observation, in order, of `SENSORS`
    noise: float = 0.0  # factor on the sensor noise: 0 for none, 1 as estimated for the real robot
    # "constant", or track speeds are part of the action: "body" one, "modules" one each, "skid" two each,
    # left and right
    track_control: str = "constant"
    tracks: str = "spheres"  # how tracks are modeled; see `ScoutConfig`
    # model of friction: "pyramidal" (fast; friction is up to 29 % smaller along the diagonals of the arena's
    # axes, and a robot at rest on a slope creeps), or "elliptic" (equal in all directions, ten times stiffer
    # against creep; a step takes 1.1 to 1.9 times as long). See the page on physics.
    contact: str = "pyramidal"
    timestep: float = 0.005  # physics step [s]
    frame_skip: int = 4  # physics steps in a control step (tick)
    timers: bool = False  # whether `info` contains the times of MuJoCo's timers
    # reset options for every episode: name -> a number, or a pair (low, high) to draw from
    randomize: Mapping[str, Any] = field(default_factory=dict)
    # standard deviations at `noise` 1; None for the defaults of `SensorNoise`
    sensor_noise: SensorNoise | None = None
    # a `Task`, or a name of `symbrion_gym.tasks.TASKS`; None for `default_task`
    task: Task | str | None = None
    # parameters of a named task; `from_options` takes them as options of their own
    task_parameters: Mapping[str, Any] = field(default_factory=dict)
    # what is kept of every episode, of `symbrion_gym._src.tasks.recorders`; `read_records` returns it
    recorders: tuple[Recorder, ...] = ()
    default_task: str = "snake_pit"  # name of the task that a registered id sets
    # parameters that a registered id sets for its own task
    default_parameters: Mapping[str, Any] = field(default_factory=dict)
    # parameter of the task, as all that follow: where it starts; None for the task's own value
    start: StartName | Point | None = None
    goal: Point | None = None  # (x, y) or (x, y, z) to be reached [m]
    bottomless: bool | None = None  # whether touching the floor of the pit ends the episode
    duration: float | None = None  # an episode is truncated after this [s]
    stuck_time: float | None = None  # time without progress after which it is truncated as well [s]
    stuck_progress: float | None = None  # smallest progress that counts as such [m]
    forward_weight: float | None = None  # reward per meter of progress
    success_bonus: float | None = None  # reward of a success
    effort_weight: float | None = None  # cost per joule of the hinges' work
    criteria: SuccessCriteria | None = None  # limits of a success
    margins: RouteMargins | None = None  # distances of the route from ramp, pit and rim
    pit_search: GapSearch | None = None  # what counts as a pit of a surface
    # the body in place of `modules`: what `load_organism` reads, or an `Organism`
    organism: int | str | Path | Organism | None = None

    def __post_init__(self) -> None:
        check_not_negative(self, _NOT_NEGATIVE, OptionError)
        check_positive(self, _POSITIVE, OptionError)
        check_not_negative(self, self._select_given(*_NOT_NEGATIVE_IF_GIVEN), OptionError)
        check_positive(self, self._select_given(*_POSITIVE_IF_GIVEN), OptionError)
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
        if self.organism is not None and self.modules != type(self).modules:
            check_organism_options({"modules": self.modules, "organism": self.organism})
        if self.timestep > MAX_TIMESTEP:
            raise OptionError(f"timestep must be at most {MAX_TIMESTEP} s, got {self.timestep}")
        check_choice("contact", self.contact, CONTACTS, OptionError)
        check_choice("track_control", self.track_control, TRACK_CONTROLS, OptionError)
        if isinstance(self.start, str):
            check_choice("start", self.start, STARTS, OptionError)
        if isinstance(self.sensors, str) or not isinstance(self.sensors, Iterable):
            raise OptionError(f"sensors must be a sequence of names, got {self.sensors!r}")
        for name in self.sensors:
            check_choice("sensors", name, SENSORS, OptionError)
        object.__setattr__(self, "sensors", tuple(dict.fromkeys(self.sensors)))
        if self.recorders:
            from symbrion_gym._src.tasks.recorders import check_recorders

            object.__setattr__(self, "recorders", check_recorders(self.recorders))
        if not isinstance(self.course, Mapping):
            raise OptionError(
                f"course is {self.course!r}; sizes by name are needed, as {{'pit': 0.5}}; for a Course give "
                "arena=Arena.from_course(course)"
            )
        for name in self.randomize:
            check_choice("randomize", name, RANDOM_OPTIONS, OptionError)

    @classmethod
    def from_options(cls, options: Mapping[str, Any]) -> EnvironmentConfig:
        """Return the configuration of keyword arguments: fields, parameters of a named task, and `default_organism`,
        the body that a registered id sets where neither `modules` nor `organism` is given.
        """
        given = dict(options)
        usual_body = given.pop("default_organism", None)
        if usual_body is not None and given.get("modules") is None and given.get("organism") is None:
            given["organism"] = usual_body
        names = [entry.name for entry in fields(cls)]
        own = () if given.keys() <= set(names) else cls._find_parameters(given)
        parameters = {name: given.pop(name) for name in list(given) if name in own and name not in names}
        for name in given:
            listed = [each for each in dict.fromkeys([*names, *own]) if not each.startswith(_INTERNAL)]
            if name not in names and name not in own:
                check_choice("option", name, listed, OptionError)
        check_organism_options(given)
        if parameters:
            given["task_parameters"] = {**given.get("task_parameters", {}), **parameters}
        return cls(**given)

    @classmethod
    def _find_parameters(cls, given: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the names of the parameters of the task that options name; none for a ready `Task`."""
        from symbrion_gym._src.tasks.catalog import find_parameters

        chosen = given.get("task") or given.get("default_task", cls.default_task)
        return find_parameters(chosen) if isinstance(chosen, str) else ()

    def _select_given(self, *names: str) -> list[str]:
        """Return those of some options that are not None."""
        return [name for name in names if getattr(self, name) is not None]

    def find_ends(self) -> tuple[Any, Any]:
        """Return start and goal: those given, else those of the registered id in its own arena."""
        is_named = isinstance(self.arena, str) and self.arena in NAMED_ARENAS
        has_start = self.start is not None and self.start != "floor"
        if self.default_ends is None or not is_named or has_start or self.goal is not None:
            return self.start, self.goal
        return self.default_ends

    def find_task(self) -> Task:
        """Return the task, with the parameters that are given."""
        from symbrion_gym._src.tasks.catalog import choose_task

        start, goal = self.find_ends()
        given = {name: getattr(self, name) for name in TASK_OPTIONS} | {"start": start, "goal": goal}
        given = {name: value for name, value in given.items() if value is not None}
        defaults = {} if self.task is not None else self.default_parameters
        return choose_task(self.task or self.default_task, {**defaults, **given, **self.task_parameters})

    @property
    def dt(self) -> float:
        """Length of a control tick [s]."""
        return self.timestep * self.frame_skip
