"""Controllers: from what the robot senses to the angles of its hinges, by the numbers of a genotype.

Each law is a plain function of sensed quantities and genotypes: a population steps as arrays, and what
one genotype does never depends on the others beside it (element-wise arithmetic only, to the bit).
The one memory is how long ago each module last touched ground, because touch flickers. Hinge i joins
module i, counted from the head, to module i + 1 behind it; a positive angle lifts the part ahead of it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evolution.errors import RunError

Structure = Mapping[str, slice]
"""Where each quantity lies in an observation, as `SnakePitEnv.observation_structure` tells."""
Sensed = Mapping[str, np.ndarray]
"""Quantities by name, each `[P, n]`, columns from head to tail.

Besides what the environment senses: "airborne" and "rested" (1 or 0)."""
Law = Callable[[Sensed, np.ndarray], np.ndarray]
"""From quantities and genotypes `[P, G]` to hinge targets `[P, n-1]` [rad]."""

SENSORS = ("hinge_angle", "pitch", "contact")
"""What every law reads of an observation."""
PATIENCE = 15
"""Ticks without touch after which a module counts as airborne (0.3 s)."""
STAMINA = 175
"""Ticks without touch after which a module no longer holds its posture in the air (3.5 s): else a head
once raised would never come down again."""
HINGE_RANGE = np.pi / 2
BOUND = 1.5
KNOTS = np.linspace(-0.55, 0.55, 12)
"""Where the travelling posture has its knots, along the way from the middle of the pit [m]."""
MODULE_PITCH = 0.1254
"""Distance between the modules of a snake [m] (Scout robots, docked)."""
HIDDEN = 4
_INPUTS = ("bias", "pitch_ahead", "pitch_behind", "air_ahead", "air_behind", "angle", "place", "head_pitch")

REACTIVE = ("bias", "head_bias", "tail_bias", "pitch_ahead", "pitch_behind")
REACTIVE += ("front_air", "rear_air", "head_pitch")


REFLEX = (-0.1, 0.0, 0.0, -0.1, 0.0, 1.1, 0.0, -0.6)
"""Where the search for a reactive law begins: lift what hangs in the air in front, keep the head level.
Set by hand, near what earlier searches had found; a near neighbour of it crossed 14 of 32 trials."""
U_SHAPE = (0.0, -0.1, -0.3, -0.5, 0.2, 1.2, 0.8, -0.3, -1.0, -0.4, -0.1, 0.0)
"""Where the search for a travelling posture begins: down at the near edge, up at the bottom, level at the far
edge (paper, section III-A)."""


class State(NamedTuple):
    """What a controller remembers.

    Attributes:
        silence: `[P, n]` ticks since each module last touched something.
    """

    silence: np.ndarray


@dataclass(frozen=True)
class Controller:
    """A law, and the genotypes it reads.

    Attributes:
        name: of the law.
        modules: length of the longest body it is for.
        parameters: name of each gene.
        law: the function.
        initial: where a search with a hint begins.
        bound: largest absolute value of a gene.
        sensors: the parts of an observation that the law reads.
    """

    name: str
    modules: int
    parameters: tuple[str, ...]
    law: Law
    initial: tuple[float, ...]
    bound: float = BOUND
    sensors: tuple[str, ...] = SENSORS

    @property
    def lower(self) -> tuple[float, ...]:
        """Smallest value of each gene."""
        return (-self.bound,) * len(self.parameters)

    @property
    def upper(self) -> tuple[float, ...]:
        """Largest value of each gene."""
        return (self.bound,) * len(self.parameters)

    def begin(self, count: int) -> State:
        """Return the state of `count` controllers before their first observation."""
        return State(np.zeros((count, self.modules), dtype=np.int64))

    def act(
        self,
        observation: np.ndarray,
        genotype: np.ndarray,
        structure: Structure,
        state: State,
    ) -> tuple[np.ndarray, State]:
        """Return actions in [-1, 1], hinge targets as a share of the hinge's range, and the new state.

        Args:
            observation: `[P, O]`.
            genotype: `[P, G]`, or `[G]` for all.
            structure: where each quantity lies in an observation.
            state: as `begin` or the call before returned it.
        """
        count = len(observation)
        genes = genotype if genotype.ndim == 2 else np.broadcast_to(genotype, (count, len(self.parameters)))
        sensed = {name: np.asarray(observation[:, structure[name]], dtype=float) for name in self.sensors}
        silence = (state.silence + 1) * (sensed["contact"] <= 0)
        sensed["airborne"] = (silence > PATIENCE).astype(float)
        sensed["rested"] = (silence <= STAMINA).astype(float)
        target = self.law(sensed, genes) / HINGE_RANGE
        return np.minimum(np.maximum(target, -1.0, out=target), 1.0, out=target), State(silence)

    def check(self, genotypes: np.ndarray) -> None:
        """Refuse genotypes that are not this controller's.

        Raises:
            RunError: wrong length, or not finite.
        """
        if genotypes.shape[-1] != len(self.parameters):
            raise RunError(
                f"genotypes of {genotypes.shape[-1]} numbers; {self.name!r} with {self.modules} modules "
                f"reads {len(self.parameters)}: {', '.join(self.parameters[:12])}"
            )
        if not np.all(np.isfinite(genotypes)):
            raise RunError("a genotype holds a number that is not finite")


def reactive(sensed: Sensed, genotype: np.ndarray) -> np.ndarray:
    """Bend each hinge by the pitch of the modules it joins, and the ends of the body that are in the air.

    Eight numbers whatever the length of the body: a bias for all hinges and one more for the first and
    the last, gains on the pitch ahead and behind, a posture for the modules between the head and the
    first that touches ground and one for those behind the last that does, and the head's pitch to its
    hinge.
    """
    bias, head_bias, tail_bias, ahead, behind, front_air, rear_air, head_pitch = genotype.T[:, :, None]
    pitch, airborne = sensed["pitch"], sensed["airborne"]
    front = np.multiply.accumulate(airborne, axis=1) * sensed["rested"]
    rear = np.multiply.accumulate(airborne[:, ::-1], axis=1)[:, ::-1] * sensed["rested"]
    target = bias + ahead * pitch[:, :-1]
    target += behind * pitch[:, 1:]
    target += front_air * front[:, :-1]
    target += rear_air * rear[:, 1:]
    target[:, :1] += head_bias + head_pitch * pitch[:, :1]
    target[:, -1:] += tail_bias
    return target


def travelling(sensed: Sensed, genotype: np.ndarray) -> np.ndarray:
    """Hold a posture fixed to the ground: each hinge takes the angle of the place it passes.

    What the head does at a place, every hinge behind it does there later (follow the leader). Twelve
    knots along the way, joined by straight lines, 0 beyond them. Where the head is, its tracks tell (dead
    reckoning from the start on the map), and where the hinges are, the pitch of the modules.
    """
    places = sensed["track_odometry"] - np.cumsum(MODULE_PITCH * np.cos(sensed["pitch"][:, :-1]), axis=1)
    return _interpolate(genotype, places)


def path(sensed: Sensed, genotype: np.ndarray) -> np.ndarray:
    """Follow a path drawn over the ground: each module takes the slope that the path has at its place.

    Twelve slopes along the way, joined by straight lines, 0 beyond them; a hinge takes the difference between the
    slopes of the modules that it joins. Unlike the angles of `travelling`, a slope bends the body where it stands
    and turns nothing far from there, so that genes act apart. Where the modules are, tracks and pitch tell.
    """
    half = 0.5 * MODULE_PITCH * np.cos(sensed["pitch"])
    behind = np.cumsum(half[:, :-1] + half[:, 1:], axis=1)
    places = sensed["track_odometry"] - np.pad(behind, ((0, 0), (1, 0)))
    slopes = _interpolate(genotype, places)
    return slopes[:, :-1] - slopes[:, 1:]


def _interpolate(genotype: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the values `[P, n]` of lines through knots `[P, G]` at places [m]; 0 beyond them."""
    position = (places - KNOTS[0]) / (KNOTS[1] - KNOTS[0])
    padded = np.pad(genotype, ((0, 0), (1, 1)))
    left = np.clip(np.floor(position), -1, len(KNOTS) - 1).astype(int)
    share = np.clip(position - left, 0.0, 1.0)
    here = np.take_along_axis(padded, left + 1, axis=1)
    there = np.take_along_axis(padded, left + 2, axis=1)
    return here + (there - here) * share


def posture(sensed: Sensed, genotype: np.ndarray) -> np.ndarray:
    """Hold one angle per hinge, from head to tail (paper, section III-A: the U shape).

    A body shorter than the genotype's reads its first genes.
    """
    return np.array(genotype[:, : sensed["hinge_angle"].shape[1]])


def network(sensed: Sensed, genotype: np.ndarray) -> np.ndarray:
    """Let a small network with one hidden layer, the same at every hinge, choose the angle."""
    angle, pitch, airborne = sensed["hinge_angle"], sensed["pitch"], sensed["airborne"]
    count = angle.shape[1]
    ones = np.ones_like(angle)
    inputs = (ones, pitch[:, :-1], pitch[:, 1:], airborne[:, :-1], airborne[:, 1:], angle)
    inputs += (ones * np.linspace(-1.0, 1.0, count), ones * pitch[:, :1])
    weights = genotype.T[:, :, None]
    target = weights[-1] * ones
    for unit in range(HIDDEN):
        first = unit * len(_INPUTS)
        activation = weights[first] * inputs[0]
        for offset in range(1, len(inputs)):
            activation = activation + weights[first + offset] * inputs[offset]
        target = target + weights[HIDDEN * len(_INPUTS) + unit] * np.tanh(activation)
    return target


def make_controller(name: str, modules: int) -> Controller:
    """Return a controller.

    Args:
        name: "path", "reactive", "travelling", "posture" or "network".
        modules: length of the longest body it is for.

    Raises:
        RunError: there is no such controller, or the body has no hinge.
    """
    if modules < 2:
        raise RunError(f"modules is {modules}; a body with a hinge has at least 2")
    if name == "reactive":
        return Controller(name, modules, REACTIVE, reactive, REFLEX)
    if name == "travelling":
        knots = tuple(f"angle_at_{100 * x:+.0f}_cm" for x in KNOTS)
        return Controller(name, modules, knots, travelling, U_SHAPE, sensors=(*SENSORS, "track_odometry"))
    if name == "path":
        slopes = tuple(f"slope_at_{100 * x:+.0f}_cm" for x in KNOTS)
        sensors = (*SENSORS, "track_odometry")
        return Controller(name, modules, slopes, path, (0.0,) * len(slopes), sensors=sensors)
    if name == "posture":
        hinges = tuple(f"hinge_{index}" for index in range(modules - 1))
        return Controller(name, modules, hinges, posture, (0.0,) * (modules - 1))
    if name == "network":
        weights = tuple(f"hidden_{unit}_{name}" for unit in range(HIDDEN) for name in _INPUTS)
        weights += (*(f"output_{unit}" for unit in range(HIDDEN)), "output_bias")
        return Controller(name, modules, weights, network, (0.0,) * len(weights), bound=4.0)
    raise RunError(f"there is no controller {name!r}; there are {', '.join(CONTROLLERS)}")


CONTROLLERS = ("path", "reactive", "travelling", "posture", "network")
