"""The laws of this package as controllers: a law, the genotypes it reads, and the memory between ticks.

The only memory is how long ago each module last touched the ground, because contact flickers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from evolution._src.controllers.joints import Drive, Joints, find_joints, find_namespace, make_drive
from evolution._src.controllers.laws import (
    NETWORK_INPUTS,
    REACTIVE_GENES,
    Law,
    network,
    path,
    posture,
    reactive,
)
from evolution._src.controllers.oscillators import OscillatorController, make_oscillators
from evolution._src.controllers.protocol import Controller as Controller
from evolution._src.controllers.protocol import Structure as Structure
from evolution._src.controllers.protocol import check_genotypes
from evolution._src.errors import RunError
from reconstruction._src.base.range_checks import check_choice, format_count
from symbrion_gym._src.robot.scout_constants import ScoutConfig

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

SENSORS = ("hinge_angle", "pitch", "contact")  # Sensors that every law reads
HINGE_RANGE = ScoutConfig().hinge_range  # Largest angle of a hinge of the usual Scout to either side [rad]
CONTACT_TIMEOUT = 15
"""Ticks without contact after which a module counts as airborne: 0.3 s bridge the flicker of contact; a head that
drives over an edge advances by 2.5 cm meanwhile."""
MAX_AIRBORNE_TICKS = 175
"""Ticks without contact (3.5 s) after which a module no longer keeps its raised posture: without a limit a raised head
would never come down again."""
NUM_KNOTS = 12  # Knots of `path`: 10 cm apart, finer than a module is long
KNOTS = np.linspace(-0.55, 0.55, NUM_KNOTS)
"""Positions of the knots from the middle of the pit [m]: they cover the pit and 0.3 m on either side."""
NUM_HIDDEN = 4  # Hidden units of `network`: its search space has 37 genes
GENE_BOUND = 1.5  # Largest absolute value of a gene, an angle [rad] or gain: nearly the range of a hinge
WEIGHT_BOUND = 4.0  # Largest absolute value of a weight of `network`: more saturates its tanh
REACTIVE_HINT = (-0.1, 0.0, 0.0, -0.1, 0.0, 1.1, 0.0, -0.6)
"""Hint for a search for a reactive law: lift what is in the air in front, keep the head level.
Set by hand, close to what earlier searches had found; a genotype close to it crossed in 14 of 32 trials."""


class State(NamedTuple):
    """The memory of controllers between ticks."""

    # number of ticks since the last contact of each module; 0 while it touches something
    ticks_since_contact: Int[Any, "P n"]


@dataclass(frozen=True, eq=False)
class LawController:
    """A law of ours on a body: it follows `Controller`.

    The genes of the tracks, where these are part of the action, come before those of the law: so a body that is
    shorter than the genotype's reads its first genes.
    """

    name: str  # name of the law
    joints: Joints  # the hinges of the body
    drive: Drive  # its tracks
    law_parameters: tuple[str, ...]  # name of each gene of the law
    law: Law  # the function
    law_initial: tuple[float, ...]  # genes of the law at which a search with a hint begins
    bound: float = GENE_BOUND  # largest absolute value of a gene
    law_sensors: tuple[str, ...] = SENSORS  # the parts of an observation that the law reads
    # largest angle of a hinge to either side [rad]; actions are relative to it
    hinge_range: float = HINGE_RANGE
    version: str = "1"  # raised when the law acts differently than before

    @property
    def modules(self) -> int:
        """Number of modules of the body."""
        return self.joints.num_modules

    @property
    def sensors(self) -> tuple[str, ...]:
        """The parts of an observation that it reads."""
        rolls = ("roll",) if self.joints.has_rolls else ()
        return (*self.law_sensors, *rolls, *self.drive.sensors)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Name of each gene."""
        return self.drive.parameters + self.law_parameters

    @property
    def initial(self) -> tuple[float, ...]:
        """Genotype at which a search with a hint begins."""
        return self.drive.initial + self.law_initial

    @property
    def lower(self) -> tuple[float, ...]:
        """Smallest value of each gene."""
        return tuple(-value for value in self.upper)

    @property
    def upper(self) -> tuple[float, ...]:
        """Largest value of each gene."""
        drive, law = len(self.drive.parameters), len(self.law_parameters)
        return (self.drive.bound,) * drive + (self.bound,) * law

    def begin(self, count: int) -> State:
        """Return the state of `count` controllers before their first observation."""
        return State(np.zeros((count, self.modules), dtype=np.int64))

    def act(
        self,
        observation: Float[Any, "P O"],
        genotype: Float[Any, "*P G"],
        structure: Structure,
        state: State,
    ) -> tuple[Float[Any, "P A"], State]:
        """Compute actions in [-1, 1], hinge targets as a share of their range, then track speeds."""
        xp = find_namespace(observation)
        genes = xp.broadcast_to(genotype, (len(observation), len(self.parameters)))
        num_drive = len(self.drive.parameters)
        sensed, state = self._sense(observation, structure, state)
        target = self.law(sensed, genes[:, num_drive:], self.joints) / self.hinge_range
        target = xp.minimum(xp.maximum(target, -1.0), 1.0)
        if not num_drive and not self.joints.num_twists:
            return target, state
        twists = xp.zeros((len(target), self.joints.num_twists))
        tracks = self.drive.act(genes[:, :num_drive], observation, structure)
        return xp.concatenate((target, twists, tracks), axis=1), state

    def _sense(
        self, observation: Float[Any, "P O"], structure: Structure, state: State
    ) -> tuple[dict[str, Float[Any, "P _"]], State]:
        """Return what the law reads, and how long ago each module touched something."""
        names = (*self.law_sensors, *(("roll",) if self.joints.has_rolls else ()))
        xp = find_namespace(observation)
        sensed = {name: xp.asarray(observation[:, structure[name]], dtype=float) for name in names}
        sensed["hinge_angle"] = sensed["hinge_angle"][:, : len(self.joints.own)]
        sensed["inclination_ahead"] = self.joints.compute_inclination_ahead(
            sensed["pitch"], sensed.get("roll")
        )
        ticks = (state.ticks_since_contact + 1) * (sensed["contact"] <= 0)
        sensed["airborne"] = (ticks > CONTACT_TIMEOUT).astype(float)
        sensed["recent_contact"] = (ticks <= MAX_AIRBORNE_TICKS).astype(float)
        return sensed, State(ticks)

    def check(self, genotypes: Float[np.ndarray, "*P G"]) -> None:
        """Refuse genotypes that do not fit; see `check_genotypes`."""
        check_genotypes(self, genotypes)


OwnController = LawController | OscillatorController  # A controller of this package


def make_law(name: str, organism: Organism, num_tracks: int = 0) -> OwnController:
    """Make a law of ours for a body."""
    check_choice("controller", name, CONTROLLERS, RunError)
    if not organism.hinges and not num_tracks:
        raise RunError(
            f"a body of {format_count(organism.num_modules, 'module')} without a hinge has nothing to control; "
            "dock modules by their fronts, or make tracks part of the action: track_control='skid'"
        )
    joints, drive = find_joints(organism), make_drive(organism, num_tracks, GENE_BOUND)
    hinge_range = organism.scout.hinge_range
    if name == "oscillators":
        return make_oscillators(joints, drive, GENE_BOUND, hinge_range, organism.scout.twist_range)
    genes, law, initial, bound, sensors = _describe_law(name, organism)
    return LawController(name, joints, drive, genes, law, initial, bound, sensors, hinge_range)


def make_controller(name: str, modules: int) -> OwnController:
    """Make a law of ours for a snake; see `make_law`."""
    check_choice("controller", name, CONTROLLERS, RunError)
    if modules < 2:
        raise RunError(f"modules is {modules}; a body with a hinge has at least 2")
    from symbrion_gym._src.robot.organism import snake

    return make_law(name, snake(modules))


def _describe_law(
    name: str, organism: Organism
) -> tuple[tuple[str, ...], Law, tuple[float, ...], float, tuple[str, ...]]:
    """Return genes, function, hint, bound and sensors of a law on a body."""
    if name == "path":
        genes = tuple(f"slope_at_{100 * x:+.0f}_cm" for x in KNOTS)
        law = partial(path, knots=KNOTS, spacing=organism.scout.pitch)
        return genes, law, (0.0,) * NUM_KNOTS, GENE_BOUND, (*SENSORS, "track_odometry")
    if name == "reactive":
        return REACTIVE_GENES, reactive, REACTIVE_HINT, GENE_BOUND, SENSORS
    if name == "posture":
        genes = tuple(f"hinge_{index}" for index in range(len(organism.hinges)))
        return genes, posture, (0.0,) * len(genes), GENE_BOUND, SENSORS
    units = range(NUM_HIDDEN)
    genes = tuple(f"hidden_{unit}_{each}" for unit in units for each in NETWORK_INPUTS)
    genes += (*(f"output_{unit}" for unit in units), "output_bias")
    return genes, partial(network, num_hidden=NUM_HIDDEN), (0.0,) * len(genes), WEIGHT_BOUND, SENSORS


CONTROLLERS = ("path", "reactive", "posture", "network", "oscillators")  # Names of the laws
