"""Parts of a configuration that a run, its champion and trials have in common: body, episode, control."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from evolution._src.backends.nested import Nested, Options, sort_options
from evolution._src.backends.stored_task import StoredTask, check_task
from evolution._src.controllers.controller import ControllerConfig
from evolution._src.controllers.finding import find_controller
from evolution._src.controllers.joints import count_tracks
from evolution._src.controllers.protocol import Controller
from evolution._src.errors import RunError
from evolution._src.references import MAX_MAGNITUDE, MAX_MODULES
from reconstruction._src.base.range_checks import (
    as_floats,
    check_choice,
    coerce_integers,
    format_count,
)
from symbrion_gym._src.environment.config import STARTS
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Organism, snake

ORIGINS = ("hint", "zero")
"""Where a search may begin."""
Point = tuple[float, ...]
"""(x, y) or (x, y, z) [m]."""


@dataclass(frozen=True)
class BodyConfig:
    """The body.

    Attributes:
        modules: number of modules of a snake, 8 unless it or `organism` is given; an `Organism` is taken for
            `organism`.
        organism: any other body: an `Organism`, or what names one, such as "H", "cross", a number of modules in a
            row, a body plan or a file.
    """

    modules: int = 8
    organism: Organism | None = None

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        if isinstance(self.modules, Organism | str):
            if self.organism is not None:
                raise RunError(
                    f"modules is {self.modules!r}, and organism is given, too; leave out one of them"
                )
            set_field(self, "organism", self.modules)
            set_field(self, "modules", BodyConfig.modules)
        if self.organism is not None:
            organism = read_organism(self.organism)
            if self.modules not in (BodyConfig.modules, organism.num_modules):
                raise RunError(
                    f"modules is {self.modules!r}, and organism is given, too; leave out one of them"
                )
            set_field(self, "organism", organism)
            set_field(self, "modules", organism.num_modules)
        coerce_integers(self, {"modules": (1, MAX_MODULES)}, RunError)

    def find_organism(self) -> Organism:
        """Return the organism."""
        return self.organism or make_snake(self.modules)


@dataclass(frozen=True)
class EpisodeConfig:
    """What is to be done in an episode: the task, and the options of the environment.

    Attributes:
        task: a `Task` or the name of one; None: to cross a pit, or to reach `goal`.
        start: where a trial begins: "pit" (close before the pit), "floor", or (x, y) or (x, y, z) [m]; None: where
            the task says, and "pit" without task and goal.
        goal: (x, y) or (x, y, z) to be reached [m], or a known object of the arena, as "object_socket_0"; None: where
            the task or the arena says.
        environment: further options of the environment, such as pit, bottomless, duration or track_control.
    """

    task: Any = None
    start: str | Point | None = None
    goal: str | Point | None = None
    environment: Options = ()

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        set_field(self, "task", check_task(self.task))
        known = None if isinstance(self.task, StoredTask) else self.task
        set_field(self, "environment", sort_options(self.environment, known))
        if isinstance(self.start, str):
            check_choice("start", self.start, STARTS, RunError)
        elif self.start is not None:
            set_field(self, "start", _as_point("start", self.start))
        if self.goal is not None:
            if not isinstance(self.goal, str):
                set_field(self, "goal", _as_point("goal", self.goal))
            elif self.task is None:
                raise RunError(
                    f"goal is {self.goal!r}, as of a known object, which needs a task: 'reach' or 'dock'; or give "
                    "(x, y) in meters"
                )
            if "goal" in dict(self.environment):
                raise RunError("goal is given, and environment.goal, too; leave out one of them")

    @property
    def track_control(self) -> str:
        """How the tracks are driven."""
        return dict(self.environment).get("track_control", "constant")

    def has_parameter(self, name: str) -> bool:
        """Return whether a parameter of the task can be given as an option of the environment."""
        if self.task is None:
            return True
        from symbrion_gym._src.tasks.catalog import find_parameters  # loads MuJoCo

        return isinstance(self.task, str) and name in find_parameters(self.task)

    def find_start(self) -> str | Point | None:
        """Return where a trial begins; None where the task says."""
        is_usual = self.start is None and self.task is None and self.goal is None
        return "pit" if is_usual else self.start

    def make_options(self) -> dict[str, Any]:
        """Return the options of the environment that these are."""
        given = {"task": self.task, "start": self.find_start(), "goal": self.goal}
        return dict(self.environment) | {name: value for name, value in given.items() if value is not None}


@dataclass(frozen=True)
class ControlConfig:
    """The controller, and where a search for its genotype begins.

    Attributes:
        controller: name of a law of ours, or a controller of a user: an object, a class or function of the organism,
            or "module:name"; see `find_controller`. Runs have "path" by default, with which a search from zero
            crosses the pit; single trials and an `Evaluator` have "reactive", whose eight genes fit any body and
            need no map.
        controller_config: parameters of the laws of ours that are not evolved.
        origin: genotype at which the search begins, "zero" (no knowledge) or "hint" (set by hand for the controller;
            then a sigma of 0.15 fits better).
    """

    controller: Any = "path"
    controller_config: ControllerConfig = field(default_factory=ControllerConfig)
    origin: str = "zero"

    def __post_init__(self) -> None:
        check_choice("origin", self.origin, ORIGINS, RunError)

    def make_controller(self, organism: Organism, episode: EpisodeConfig) -> Controller:
        """Return the controller for a body."""
        num_tracks = count_tracks(episode.track_control, organism.num_modules)
        return find_controller(self.controller, organism, self.controller_config, num_tracks)


def check_body_options(values: Mapping[str, Any]) -> None:
    """Refuse two bodies: a number of modules, and an organism with another number."""
    modules, organism = values.get("modules"), values.get("organism")
    if modules is None or organism is None or isinstance(modules, Organism | str):
        return
    count = read_organism(organism).num_modules
    if modules != count:
        raise RunError(
            f"modules is {modules!r} and organism, too, is given, of {format_count(count, 'module')}; leave out one of "
            "them"
        )


def take_environment(config: Nested, others: dict[str, Any]) -> None:
    """Take options of the environment as those of the episode of a configuration; only while it is made."""
    if others:
        config.set_field("environment", dict(config.episode.environment) | others)


def read_organism(organism: Organism | int | str | PathLike[str]) -> Organism:
    """Return the organism that something names; a number is the length of a snake."""
    if isinstance(organism, Organism):
        return organism
    from symbrion_gym._src.robot.body_plans import load_organism

    try:
        return load_organism(organism if isinstance(organism, int) else str(organism))
    except (OrganismError, OSError) as error:
        raise RunError(f"organism: {error}") from error


@functools.lru_cache(maxsize=MAX_MODULES)
def make_snake(modules: int) -> Organism:
    """Return a snake of Scouts."""
    return snake(modules)


def _as_point(name: str, values: Any) -> Point:
    try:
        point = as_floats(name, np.ravel(values).tolist(), -MAX_MAGNITUDE, MAX_MAGNITUDE, RunError)
    except (TypeError, ValueError, RunError) as error:
        raise RunError(f"{name} is {values!r}; (x, y) or (x, y, z) in meters is needed") from error
    if len(point) not in (2, 3):
        raise RunError(f"{name} is {values!r}; (x, y) or (x, y, z) in meters is needed")
    return point
