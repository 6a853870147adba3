"""The names under which Gymnasium makes the environments."""

from copy import copy
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from symbrion_gym._src.robot.scout_constants import DEFAULT_SENSORS

_RANDOMIZE = {
    "friction": (0.55, 0.9),
    "torque_scale": (0.9, 1.1),
    "start_offset": (-0.05, 0.05),
    "start_lateral": (-0.05, 0.05),
    "yaw": (-0.0873, 0.0873),
}
"""What differs from episode to episode: friction, strength of the hinges, start [m] and heading [rad]."""
_LOW_FRICTION = (0.55, 0.7)
"""Where it is higher, a body whose tracks always run gets out of the pit by jerking its hinges at random."""
_TURNED = {**_RANDOMIZE, "yaw": (-3.14, 3.14)}


_Entry = tuple[dict[str, Any], float]


def _task(name: str, threshold: float, parameters: dict[str, Any] | None = None, **options: Any) -> _Entry:
    """Return the options of an id, and nine tenths of the return of its reference: so much counts as solved."""
    task = {"default_task": name, "default_parameters": parameters or {}, "randomize": _RANDOMIZE}
    return task | options, threshold


def _two_steps(rise: float) -> dict[str, Any]:
    return {"stairs": {"rise": rise, "steps": 2, "floor": 1.2, "plateau": 1.2}}


_ROW: dict[str, Any] = {"track_control": "body"}
_CLIMB = {**_ROW, "default_arena": "stairs"}
_BRISK = {"duration": 16.0, "stuck_time": 5.0}
"""With more time, noise that holds targets of the hinges climbs, too."""
_LONE = {"default_arena": "gsrm", "default_organism": 1, "track_control": "skid", "randomize": _TURNED}
_SPECS: dict[str, _Entry] = {
    "SnakePit-v1": ({"randomize": {**_RANDOMIZE, "friction": _LOW_FRICTION}}, 3.0),
    "CrossGap-easy-v0": _task("cross_gap", 3.0, **_ROW),
    "CrossGap-v0": _task("cross_gap", 2.8, **_ROW, default_organism=5, default_pit=0.35),
    "Climb-easy-v0": _task(
        "climb", 1.4, _BRISK, **_CLIMB, default_organism=3, default_course=_two_steps(0.05)
    ),
    "Climb-v0": _task("climb", 1.5, _BRISK, **_CLIMB, default_organism=5, default_course=_two_steps(0.11)),
    "Traverse-v0": _task("traverse", 4.1, **_ROW, default_arena="gsrm"),
    "Reach-easy-v0": _task("reach", 2.1, {"distance": 1.5}, **_LONE, sensors=(*DEFAULT_SENSORS, "goal")),
}
ENVIRONMENTS: dict[str, dict[str, Any]] = {
    f"symbrion_gym/{name}": options for name, (options, _) in _SPECS.items()
}
"""Id -> options that differ from those of `OrganismEnv`."""


_HARMLESS = (
    "sensors noise sensor_noise recorders timers progress render_mode width height num_envs num_threads "
    "vectorization_mode autoreset_mode backend array device num_starts max_contacts"
)
"""Options that leave the task of an id as it is."""


class KnowsLimits:
    """An environment whose `spec` says how long its episodes are, and from which return on its id is solved.

    A task of the user's own has neither, and an id with other options no such return.
    """

    config: Any  # its options
    world: Any  # its arena, body and task
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """What `gymnasium.make` made it of; None where it was made directly."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            spec = copy(spec)
            usual = ENVIRONMENTS.get(spec.id, {})
            usual = {**usual, "arena": usual.get("default_arena", "truth")}
            options = {**usual, **spec.kwargs}
            changed = [name for name, value in options.items() if repr(value) != repr(usual.get(name))]
            if not set(_HARMLESS.split()).issuperset(changed):
                spec.reward_threshold = None
            duration = round(self.world.task.duration / self.config.dt)
            spec.max_episode_steps = (
                None if "task" in changed else spec.kwargs.get("max_episode_steps", duration)
            )
        self._spec = spec


def register() -> None:
    """Register every environment; a second call changes nothing."""
    for name, (options, threshold) in _SPECS.items():
        if f"symbrion_gym/{name}" not in gym.registry:
            gym.register(
                f"symbrion_gym/{name}",
                entry_point="symbrion_gym._src.environment.organism_env:OrganismEnv",
                vector_entry_point="symbrion_gym._src.environment.making:make_vector_env",
                reward_threshold=threshold,  # from which on its task counts as solved
                kwargs=dict(options),
            )
