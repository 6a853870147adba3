"""What a run, its trials and its champion have in common: where, which body, what it is to do, what controls it."""

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from functools import lru_cache
from os import PathLike
from types import FunctionType
from typing import Any, ClassVar, Self, get_type_hints

import numpy as np

from evolution._src.backends.scoring import Scoring, check_descriptors
from evolution._src.controllers.finding import ControllerSource, controller_to_json, find_controller, freeze
from evolution._src.controllers.protocol import Controller
from evolution._src.errors import RunError
from evolution._src.references import MAX_MAGNITUDE, MAX_MODULES, MIN_POSITIVE, Stored, find_value, store
from reconstruction._src.base.range_checks import (
    as_floats,
    as_range,
    check_choice,
    check_count,
    coerce_floats,
    coerce_integers,
    format_count,
)
from reconstruction._src.base.typed_json import JsonError, as_type
from symbrion_gym._src.environment.config import RANDOM_LIMITS, STARTS, EnvironmentConfig, count_tracks
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Organism, snake

ORIGINS = ("hint", "zero")  # Where a search may begin
Point = tuple[float, ...]  # (x, y) or (x, y, z) [m]
Options = tuple[tuple[str, Any], ...]  # Name and value of each option of the environment, sorted by name
_OWN_FIELDS = ("arena", "modules", "organism", "task", "start")
"""Options of the environment that are fields of a configuration."""
_USUAL_MODULES = 8
_MAX_STRETCHES = 100  # Each is a separate arena in memory
_STRETCH_LIMITS = (0.1, 10.0)
MAX_ENVIRONMENTS = 12  # Compiled vector environments that a process keeps, of each stretch of an arena
CONDITIONS = ("friction", "torque_scale", "start_offset", "yaw", "patch_friction")
"""Conditions of a trial that are sampled from a range, in this order, and set when the environment is reset."""
Range = tuple[float, float]
_OPEN = ("task", "scoring", "descriptors")
"""Fields that take values of a user, which a file keeps as `Stored`."""
_TYPES_IN_FILES: dict[str, Any] = {
    "arena": str,
    "modules": int,
    "task": str | None,
    "controller": str | dict[str, Any],
    "scoring": Scoring,
    "descriptors": tuple[()],
}
"""Types of fields in a file, where these are not `Stored`."""


class _TakesOptions(type):
    """Of classes that take what is no field as an option of the environment: `EvolutionConfig(pit=0.4)`."""

    def __call__(cls, *arguments: Any, **values: Any) -> Any:
        names = {each.name for each in fields(cls)}  # pyright: ignore[reportArgumentType]
        options = {name: values.pop(name) for name in list(values) if name not in names}
        if options:
            values["environment"] = dict(values.get("environment", ())) | options
        return super().__call__(*arguments, **values)


@dataclass(frozen=True, kw_only=True)
class EpisodeConfig(metaclass=_TakesOptions):
    """Where an episode takes place, what is to be done, and by which controller.

    Attributes:
        arena: name, folder or file of the arena.
        task: a `Task` or the name of one; None: to cross a pit, or to reach `goal`.
        start: where a trial begins: "pit" (close before the pit), "floor", or (x, y) or (x, y, z) [m]; None: where
            the task says, and "pit" without task and goal.
        goal: (x, y) or (x, y, z) to be reached [m], or a known object of the arena, as "object_socket_0"; None: where
            the task or the arena says.
        environment: further options of the environment, such as pit, bottomless, duration or track_control.
        controller: name of a law of ours, or a controller of a user: an object, a class or function of the organism,
            or "module:name"; see `find_controller`. Runs have "path" by default, with which a search from zero
            crosses the pit; single trials and an `Evaluator` have "reactive", whose eight genes fit any body and
            need no map; searches for bodies have "oscillators".
        origin: genotype at which the search begins, "zero" (no knowledge) or "hint" (set by hand for the controller;
            then a sigma of 0.15 fits better).
    """

    OTHERS: ClassVar[tuple[str, ...]] = ()  # Names that messages list although they are no fields

    arena: Any = "gsrm"
    task: Any = None
    start: str | Point | None = None
    goal: str | Point | None = None
    environment: Options = ()
    controller: Any = "path"
    origin: str = "zero"

    def __post_init__(self) -> None:
        self._set("task", _check_task(self.task))
        self._set("environment", self._sort_options())
        if isinstance(self.start, str):
            check_choice("start", self.start, STARTS, RunError)
        elif self.start is not None:
            self._set("start", _as_point("start", self.start))
        if self.goal is not None:
            self._check_goal(self.goal)
        check_choice("origin", self.origin, ORIGINS, RunError)

    def _sort_options(self) -> Options:
        """Return options of the environment as sorted pairs, lists in them as tuples."""
        given = self.environment
        pairs = given.items() if isinstance(given, Mapping) else given
        found = tuple(sorted((str(name), freeze(value)) for name, value in pairs))
        for name, value in found:
            if name in _OWN_FIELDS:
                raise RunError(
                    f"environment.{name} is {value!r}, which would be overwritten; give {name} itself"
                )
            try:
                hash(value)
            except TypeError:
                raise RunError(
                    f"environment.{name} is {value!r}; a number, text or list of these is needed"
                ) from None
        options = dict(found) | {"task": None if isinstance(self.task, Stored) else self.task}
        names = [each.name for each in fields(self)]
        try:
            EnvironmentConfig.check_names(options, (*names, *self.OTHERS), type(self).__name__, RunError)
            EnvironmentConfig.from_options(options)
        except (TypeError, ValueError) as error:
            raise RunError(f"environment: {error}") from error
        return found

    def _check_goal(self, goal: str | Point) -> None:
        if not isinstance(goal, str):
            self._set("goal", _as_point("goal", goal))
        elif self.task is None:
            raise RunError(
                f"goal is {goal!r}, as of a known object, which needs a task: 'reach' or 'dock'; or give (x, y) in "
                "meters"
            )
        if "goal" in dict(self.environment):
            raise RunError("goal is given, and environment.goal, too; leave out one of them")

    def _set(self, name: str, value: Any) -> None:
        """Set a field; only while this is made."""
        object.__setattr__(self, name, value)

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

    def make_controller(self, organism: Organism) -> Controller:
        """Return the controller for a body."""
        num_tracks = count_tracks(self.track_control, organism.num_modules)
        return find_controller(self.controller, organism, num_tracks)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON content of all fields.

        Raises:
            RunError: a part is an object of a user that nothing would restore.
        """
        types = _list_types(type(self)).items()
        content = {name: _to_plain(name, getattr(self, name), kind) for name, kind in types}
        try:
            return json.loads(json.dumps(content | {"environment": dict(self.environment)}))
        except TypeError as error:
            raise RunError(
                f"environment: {error}, and a run is stored as text; use numbers and names"
            ) from error

    @classmethod
    def from_json(cls, content: object, where: str = "config") -> Self:
        """Return what `to_json` described; this imports nothing.

        Raises:
            RunError: a field is missing or unknown, or its value of the wrong kind.
        """
        kinds = _list_types(cls)
        if not isinstance(content, dict):
            raise RunError(f"{where or 'content'} is {content!r}; an object is needed")
        unknown = sorted(set(map(str, content)) - set(kinds))
        if unknown:
            raise RunError(f"{where or 'it'} has unknown entries {unknown}; there are {', '.join(kinds)}")
        lead = f"{where}." if where else ""
        return cls(
            **{name: _from_plain(name, each, kinds[name], lead + name) for name, each in content.items()}
        )

    def restore(self, allow: Collection[str] = ()) -> Self:
        """Return the same with what a user wrote imported again, from modules in `allow` alone.

        Raises:
            RunError: something cannot be imported, is not allowed, or has changed since it was stored.
        """
        changes: dict[str, Any] = {}
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, Stored):
                changes[each.name] = value.restore(each.name, allow)
            elif isinstance(value, ControllerSource):
                changes[each.name] = value.allow(allow)
        return replace(self, **changes) if changes else self


def _list_types(cls: type[EpisodeConfig]) -> dict[str, Any]:
    """Return the type of each field in a file."""
    kinds = get_type_hints(cls) | _TYPES_IN_FILES
    return {each.name: kinds[each.name] for each in fields(cls)}


def _to_plain(name: str, value: Any, kind: Any) -> Any:
    """Return JSON content of a field."""
    if isinstance(value, Stored):
        return json.loads(value.text)
    if name == "controller":
        return controller_to_json(value)
    if name in _OPEN and not (
        value is None or value == () or isinstance(value, str) or type(value) is Scoring
    ):
        return store(value, name)
    if not is_dataclass(value):
        return value
    if isinstance(kind, type) and type(value) is not kind:
        raise RunError(
            f"{name} is a {type(value).__qualname__}, which a file does not keep; use {kind.__name__}"
        )
    return asdict(value)  # pyright: ignore[reportArgumentType]


def _from_plain(name: str, value: Any, kind: Any, where: str) -> Any:
    """Return a field of its JSON content."""
    if name in _OPEN and isinstance(value, dict) and "value" in value:
        return Stored(json.dumps(value, sort_keys=True))
    if name == "environment" and isinstance(value, dict):
        value = list(value.items())
    if name in ("controller", "task") and isinstance(value, str) and ":" in value:
        raise RunError(f"{where} is {value!r}; files name code by an object with its version, not as text")
    try:
        return as_type(value, kind, where)
    except JsonError as error:
        raise RunError(str(error)) from error


@dataclass(frozen=True, kw_only=True)
class BodyConfig:
    """The body.

    Attributes:
        modules: number of modules, of a snake unless `organism` is given; None: 8, or those of the organism. An
            `Organism` is taken for `organism`.
        organism: any other body: an `Organism`, or what names one, such as "H", "cross", a number of modules in a
            row, a body plan or a file.
    """

    modules: Any = None
    organism: Organism | None = None

    def check_body(self) -> None:
        """Read the body; called while a configuration is made."""
        given, modules = self.organism, self.modules
        if isinstance(modules, Organism | str):
            if given is not None:
                raise RunError(f"modules is {modules!r}, and organism is given, too; leave out one of them")
            given, modules = modules, None
        if given is not None:
            given = read_organism(given)
            if modules not in (None, given.num_modules):
                raise RunError(
                    f"modules is {modules!r} and organism, too, is given, of "
                    f"{format_count(given.num_modules, 'module')}; leave out one of them"
                )
            modules = given.num_modules
        object.__setattr__(self, "organism", given)
        object.__setattr__(self, "modules", _USUAL_MODULES if modules is None else modules)
        coerce_integers(self, {"modules": (1, MAX_MODULES)}, RunError)

    def find_organism(self) -> Organism:
        """Return the organism."""
        return self.organism or _make_snake(self.modules)


@dataclass(frozen=True)
class Randomization:
    """Ranges that the conditions of trials are sampled from.

    Sampling is uniform and stratified (a Latin hypercube): of n trials each lies in another n-th of every range,
    which reduces the variance of their mean.

    Attributes:
        friction: sliding friction between tracks and ground.
        torque_scale: strength of the hinges relative to the nominal one.
        start_offset: along the course [m].
        yaw: heading at the start [rad].
        stretch: factors on the length of the arena, as the scan may be wrong; the trials take turns.
        patch_friction: where in their intervals the frictions of patches lie (`Arena.friction_map`): 0 is the middle,
            -1 and 1 are the ends of the 95 % interval; only for arenas with patches.
    """

    friction: Range = (0.55, 0.9)
    torque_scale: Range = (0.9, 1.1)
    start_offset: Range = (-0.05, 0.05)
    yaw: Range = (-0.0873, 0.0873)
    stretch: tuple[float, ...] = (0.975, 1.0, 1.025)
    patch_friction: Range = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in CONDITIONS:
            limits = as_range(name, getattr(self, name), *RANDOM_LIMITS[name], RunError)
            object.__setattr__(self, name, limits)
        object.__setattr__(self, "stretch", as_floats("stretch", self.stretch, *_STRETCH_LIMITS, RunError))
        check_count("stretch", self.stretch, _MAX_STRETCHES, RunError)

    def draw(self, seed: Iterable[int], count: int) -> dict[str, np.ndarray]:
        """Sample `count` values of each condition; equal seeds give equal values."""
        rng = np.random.default_rng(list(seed))
        names = [name for name in CONDITIONS if name != "patch_friction"]
        conditions = {name: _sample_stratified(rng, getattr(self, name), count) for name in names}
        turns = np.resize(rng.permutation(len(self.stretch)), count)
        conditions |= {"stretch": np.asarray(self.stretch, dtype=float)[turns]}
        if self.patch_friction != (0.0, 0.0):
            conditions |= {"patch_friction": _sample_stratified(rng, self.patch_friction, count)}
        return conditions


def _sample_stratified(rng: np.random.Generator, limits: Range, count: int) -> np.ndarray:
    """Return one value from each of equal parts of a range, `[count]`."""
    share = (rng.permutation(count) + rng.uniform(size=count)) / count
    return limits[0] + (limits[1] - limits[0]) * share


@dataclass(frozen=True)
class RolloutConfig:
    """How trials are simulated.

    Attributes:
        stuck_time: a body without progress for this long ends its trial [s], unless the options of the environment say
            otherwise. Shorter than the environment's default: a controller without memory that made no progress in 5 s
            will make none. Changes results.
    """

    stuck_time: float = 5.0

    def __post_init__(self) -> None:
        coerce_floats(self, {"stuck_time": (MIN_POSITIVE, MAX_MAGNITUDE)}, RunError)


@dataclass(frozen=True, kw_only=True)
class TrialConfig(EpisodeConfig):
    """An episode that is tried: how trials vary, how they are simulated and what is kept of them.

    Attributes:
        randomization: ranges from which the conditions of the trials are sampled.
        rollout: parameters of the simulation of trials.
        descriptors: what outcomes keep of every trial beside progress and success: "pose" (final positions and
            rotations), "extremes" (lowest and highest positions), "contacts", "trajectory" (thinned), recorders of
            `symbrion_gym._src.tasks.recorders`, or functions of a `TaskState`. None by default, as some cost time.
    """

    randomization: Randomization = field(default_factory=Randomization)
    rollout: RolloutConfig = field(default_factory=RolloutConfig)
    descriptors: Any = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set("descriptors", check_descriptors(self.descriptors))


def take_fields(source: Any, *kinds: type) -> dict[str, Any]:
    """Return name and value of the fields of bases of a configuration."""
    return {each.name: getattr(source, each.name) for kind in kinds for each in fields(kind)}


def read_organism(organism: Organism | int | str | PathLike[str]) -> Organism:
    """Return the organism that something names; a number is the length of a snake."""
    if isinstance(organism, Organism):
        return organism
    from symbrion_gym._src.robot.body_plans import load_organism

    try:
        return load_organism(organism if isinstance(organism, int) else str(organism))
    except (OrganismError, OSError) as error:
        raise RunError(f"organism: {error}") from error


_make_snake = lru_cache(maxsize=MAX_MODULES)(snake)


def _as_point(name: str, values: Any) -> Point:
    try:
        point = as_floats(name, np.ravel(values).tolist(), -MAX_MAGNITUDE, MAX_MAGNITUDE, RunError)
    except (TypeError, ValueError, RunError):
        point = ()
    if len(point) not in (2, 3):
        raise RunError(f"{name} is {values!r}; (x, y) or (x, y, z) in meters is needed")
    return point


def _check_task(task: Any) -> Any:
    """Return a task: None, a `Task`, its name, "module:name" of one or of its maker, or what a file says of it."""
    if task is None or isinstance(task, Stored):
        return task
    from symbrion_gym._src.tasks.catalog import TASKS
    from symbrion_gym._src.tasks.task import Task

    if isinstance(task, str) and task in TASKS:
        return task
    found = find_value(task, "task") if isinstance(task, str) and ":" in task else task
    if isinstance(found, FunctionType):
        try:
            found = found()
        except Exception as error:  # code of the user
            raise RunError(f"task {task} cannot be made: {error}") from error
    if isinstance(found, Task):
        return found
    raise RunError(
        f"task is {task!r}; a `Task`, 'module:name' of one, or one of {', '.join(TASKS)} is needed"
    )
