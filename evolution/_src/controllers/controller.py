"""The laws of this package as controllers: a law, the genotypes it reads, and the memory between ticks.

The only memory is how long ago each module last touched the ground, because contact flickers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from evolution._src.controllers.config import NUM_KNOTS as NUM_KNOTS
from evolution._src.controllers.config import ControllerConfig as ControllerConfig
from evolution._src.controllers.config import OscillatorConfig
from evolution._src.controllers.joints import Drive, Joints, find_joints, find_namespace, make_drive
from evolution._src.controllers.laws import (
    NETWORK_INPUTS,
    REACTIVE_GENES,
    Law,
    network,
    path,
    posture,
    reactive,
    travelling,
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
REACTIVE_HINT = (-0.1, 0.0, 0.0, -0.1, 0.0, 1.1, 0.0, -0.6)
"""Hint for a search for a reactive law: lift what is in the air in front, keep the head level.
Set by hand, close to what earlier searches had found; a genotype close to it crossed in 14 of 32 trials."""
U_SHAPE_HINT = (0.0, -0.1, -0.3, -0.5, 0.2, 1.2, 0.8, -0.3, -1.0, -0.4, -0.1, 0.0)
"""Hint for a search for a travelling posture: down at the near edge, up at the bottom, level at the far
edge (paper, section III-A)."""


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
    bound: float = ControllerConfig.gene_bound  # largest absolute value of a gene
    law_sensors: tuple[str, ...] = SENSORS  # the parts of an observation that the law reads
    # largest angle of a hinge to either side [rad]; actions are relative to it
    hinge_range: float = HINGE_RANGE
    config: ControllerConfig = field(default_factory=ControllerConfig)  # parameters that are not evolved
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
        sensed["airborne"] = (ticks > self.config.contact_timeout).astype(float)
        sensed["recent_contact"] = (ticks <= self.config.max_airborne_ticks).astype(float)
        return sensed, State(ticks)

    def check(self, genotypes: Float[np.ndarray, "*P G"]) -> None:
        """Refuse genotypes that do not fit; see `check_genotypes`."""
        check_genotypes(self, genotypes)


OwnController = LawController | OscillatorController  # A controller of this package


def make_law(
    name: str, organism: Organism, config: ControllerConfig | None = None, num_tracks: int = 0
) -> OwnController:
    """Make a law of ours for a body."""
    check_choice("controller", name, CONTROLLERS, RunError)
    if not organism.hinges and not num_tracks:
        raise RunError(
            f"a body of {format_count(organism.num_modules, 'module')} without a hinge has nothing to control; "
            "dock modules by their fronts, or make tracks part of the action: track_control='skid'"
        )
    config = config or ControllerConfig()
    body = {
        "joints": find_joints(organism),
        "drive": make_drive(organism, num_tracks, config.gene_bound),
        "hinge_range": organism.scout.hinge_range,
        "config": config,
    }
    return _MAKERS[name](organism, config, body)


def make_controller(name: str, modules: int, config: ControllerConfig | None = None) -> OwnController:
    """Make a law of ours for a snake; see `make_law`."""
    check_choice("controller", name, CONTROLLERS, RunError)
    if modules < 2:
        raise RunError(f"modules is {modules}; a body with a hinge has at least 2")
    from symbrion_gym._src.robot.organism import snake

    return make_law(name, snake(modules), config)


def _make_path(organism: Organism, config: ControllerConfig, body: dict[str, Any]) -> LawController:
    return _make_knotted("path", path, "slope", (0.0,) * NUM_KNOTS, organism, body)


def _make_reactive(organism: Organism, config: ControllerConfig, body: dict[str, Any]) -> LawController:
    return LawController(
        name="reactive",
        law_parameters=REACTIVE_GENES,
        law=reactive,
        law_initial=REACTIVE_HINT,
        bound=config.gene_bound,
        **body,
    )


def _make_travelling(organism: Organism, config: ControllerConfig, body: dict[str, Any]) -> LawController:
    return _make_knotted("travelling", travelling, "angle", U_SHAPE_HINT, organism, body)


def _make_knotted(
    name: str,
    law: Callable[..., Float[np.ndarray, "P H"]],
    quantity: str,
    initial: tuple[float, ...],
    organism: Organism,
    body: dict[str, Any],
) -> LawController:
    """Make a controller whose genes are values of a quantity at knots along the course."""
    config: ControllerConfig = body["config"]
    knots = config.knots
    return LawController(
        name=name,
        law_parameters=tuple(f"{quantity}_at_{100 * x:+.0f}_cm" for x in knots),
        law=partial(law, knots=knots, spacing=organism.scout.pitch),
        law_initial=initial,
        bound=config.gene_bound,
        law_sensors=(*SENSORS, "track_odometry"),
        **body,
    )


def _make_posture(organism: Organism, config: ControllerConfig, body: dict[str, Any]) -> LawController:
    hinges = tuple(f"hinge_{index}" for index in range(len(organism.hinges)))
    initial = (0.0,) * len(hinges)
    return LawController(
        name="posture",
        law_parameters=hinges,
        law=posture,
        law_initial=initial,
        bound=config.gene_bound,
        **body,
    )


def _make_network(organism: Organism, config: ControllerConfig, body: dict[str, Any]) -> LawController:
    units = range(config.num_hidden)
    weights = tuple(f"hidden_{unit}_{name}" for unit in units for name in NETWORK_INPUTS)
    weights += (*(f"output_{unit}" for unit in units), "output_bias")
    return LawController(
        name="network",
        law_parameters=weights,
        law=partial(network, num_hidden=config.num_hidden),
        law_initial=(0.0,) * len(weights),
        bound=config.weight_bound,
        **body,
    )


def _make_oscillators(
    organism: Organism, config: ControllerConfig, body: dict[str, Any]
) -> OscillatorController:
    body = {name: body[name] for name in ("joints", "drive", "hinge_range")}
    body["twist_range"] = organism.scout.twist_range
    return make_oscillators(config.oscillators or OscillatorConfig(), config.gene_bound, **body)


_MAKERS: dict[str, Callable[[Organism, ControllerConfig, dict[str, Any]], OwnController]] = {
    "path": _make_path,
    "reactive": _make_reactive,
    "travelling": _make_travelling,
    "posture": _make_posture,
    "network": _make_network,
    "oscillators": _make_oscillators,
}
CONTROLLERS = tuple(_MAKERS)  # Names of the controllers
