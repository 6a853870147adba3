"""Controllers: a control law, the genotypes it reads, and the memory between ticks.

The only memory is how long ago each module last touched the ground, because contact flickers.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from evolution.controllers.laws import (
    NETWORK_INPUTS,
    REACTIVE_GENES,
    Law,
    network,
    path,
    posture,
    reactive,
    travelling,
)
from evolution.errors import RunError
from evolution.limits import MAX_MAGNITUDE, MIN_POSITIVE
from reconstruction.range_checks import as_range, check_choice, coerce_floats, coerce_integers
from symbrion_gym.robot.scout_constants import ScoutConfig

Structure = Mapping[str, slice]
"""Where each quantity lies in an observation, as in `SnakePitEnv.observation_structure`."""

SENSORS = ("hinge_angle", "pitch", "contact")
"""Sensors that every law reads."""
HINGE_RANGE = ScoutConfig().hinge_range
"""Largest angle of a hinge to either side [rad]; actions are relative to it."""
REACTIVE_HINT = (-0.1, 0.0, 0.0, -0.1, 0.0, 1.1, 0.0, -0.6)
"""Hint for a search for a reactive law: lift what is in the air in front, keep the head level.
Set by hand, close to what earlier searches had found; a genotype close to it crossed in 14 of 32 trials."""
U_SHAPE_HINT = (0.0, -0.1, -0.3, -0.5, 0.2, 1.2, 0.8, -0.3, -1.0, -0.4, -0.1, 0.0)
"""Hint for a search for a travelling posture: down at the near edge, up at the bottom, level at the far
edge (paper, section III-A)."""
NUM_KNOTS = len(U_SHAPE_HINT)
"""Knots of `travelling` and `path`: 10 cm apart, finer than a module is long."""


_MAX_TICKS, _MAX_HIDDEN = 10**9, 1000


@dataclass(frozen=True)
class ControllerConfig:
    """Parameters of the laws that are not evolved.

    Attributes:
        contact_timeout: ticks without contact after which a module counts as airborne. 15 (0.3 s) bridge the
            flicker of contact; a head that drives over an edge advances by 2.5 cm meanwhile.
        max_airborne_ticks: ticks without contact after which a module no longer keeps its raised posture. 175 (3.5 s);
            without a limit a raised head would never come down again.
        knot_range: position of the first and the last knot of `travelling` and `path`, from the middle of the
            pit [m]. They cover the pit and 0.3 m on either side.
        num_hidden: hidden units of `network`; four keep its search space at 37 genes.
        gene_bound: largest absolute value of a gene, an angle [rad] or gain: nearly the range of a hinge.
        weight_bound: largest absolute value of a weight of `network`; more saturates its tanh.
    """

    contact_timeout: int = 15
    max_airborne_ticks: int = 175
    knot_range: tuple[float, float] = (-0.55, 0.55)
    num_hidden: int = 4
    gene_bound: float = 1.5
    weight_bound: float = 4.0

    def __post_init__(self) -> None:
        ticks = (0, _MAX_TICKS)
        coerce_integers(
            self,
            {"contact_timeout": ticks, "max_airborne_ticks": ticks, "num_hidden": (1, _MAX_HIDDEN)},
            RunError,
        )
        coerce_floats(
            self, dict.fromkeys(("gene_bound", "weight_bound"), (MIN_POSITIVE, MAX_MAGNITUDE)), RunError
        )
        low, high = as_range("knot_range", self.knot_range, -MAX_MAGNITUDE, MAX_MAGNITUDE, RunError)
        if not low < high:
            raise RunError(f"knot_range is {self.knot_range!r}; first < last is needed")
        object.__setattr__(self, "knot_range", (low, high))

    @property
    def knots(self) -> Float[np.ndarray, " G"]:
        """Positions of the knots [m]."""
        return np.linspace(*self.knot_range, NUM_KNOTS)


class State(NamedTuple):
    """The memory of controllers between ticks.

    Attributes:
        ticks_since_contact: number of ticks since the last contact of each module; 0 while it touches something.
    """

    ticks_since_contact: Int[np.ndarray, "P n"]


@dataclass(frozen=True)
class Controller:
    """A law, and the genotypes it reads.

    Attributes:
        name: name of the law.
        modules: length of the longest body it is for.
        parameters: name of each gene.
        law: the function.
        initial: genotype at which a search with a hint begins.
        bound: largest absolute value of a gene.
        sensors: the parts of an observation that the law reads.
        config: parameters that are not evolved.
    """

    name: str
    modules: int
    parameters: tuple[str, ...]
    law: Law
    initial: tuple[float, ...]
    bound: float = ControllerConfig.gene_bound
    sensors: tuple[str, ...] = SENSORS
    config: ControllerConfig = ControllerConfig()

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
        observation: Float[np.ndarray, "P O"],
        genotype: Float[np.ndarray, "*P G"],
        structure: Structure,
        state: State,
    ) -> tuple[Float[np.ndarray, "P H"], State]:
        """Compute actions in [-1, 1], hinge targets as a share of the hinge's range, and the new state.

        Args:
            observation: one row for each controller.
            genotype: one row for each controller, or one genotype for all.
            structure: slice of each quantity in an observation.
            state: as returned by `begin` or the previous call.
        """
        count = len(observation)
        genes = genotype if genotype.ndim == 2 else np.broadcast_to(genotype, (count, len(self.parameters)))
        sensed = {name: np.asarray(observation[:, structure[name]], dtype=float) for name in self.sensors}
        ticks = (state.ticks_since_contact + 1) * (sensed["contact"] <= 0)
        sensed["airborne"] = (ticks > self.config.contact_timeout).astype(float)
        sensed["recent_contact"] = (ticks <= self.config.max_airborne_ticks).astype(float)
        target = self.law(sensed, genes) / HINGE_RANGE
        return np.minimum(np.maximum(target, -1.0, out=target), 1.0, out=target), State(ticks)

    def check(self, genotypes: Float[np.ndarray, "*P G"]) -> None:
        """Refuse genotypes that do not fit this controller.

        Raises:
            RunError: wrong length, or not finite.
        """
        if genotypes.shape[-1] != len(self.parameters):
            raise RunError(
                f"genotypes of {genotypes.shape[-1]} numbers; {self.name!r} with {self.modules} modules "
                f"reads {len(self.parameters)}: {', '.join(self.parameters[:12])}"
            )
        if not np.all(np.isfinite(genotypes)):
            raise RunError("a genotype has a number that is not finite")


def make_controller(name: str, modules: int, config: ControllerConfig | None = None) -> Controller:
    """Make a controller.

    Args:
        name: "path", "reactive", "travelling", "posture" or "network".
        modules: length of the longest body it is for.
        config: parameters that are not evolved.

    Raises:
        RunError: there is no such controller, or the body has no hinge.
    """
    if modules < 2:
        raise RunError(f"modules is {modules}; a body with a hinge has at least 2")
    check_choice("controller", name, CONTROLLERS, RunError)
    return _MAKERS[name](modules, config or ControllerConfig())


def _make_path(modules: int, config: ControllerConfig) -> Controller:
    return _make_knotted("path", path, "slope", (0.0,) * NUM_KNOTS, modules, config)


def _make_reactive(modules: int, config: ControllerConfig) -> Controller:
    bound = config.gene_bound
    return Controller(
        "reactive", modules, REACTIVE_GENES, reactive, REACTIVE_HINT, bound=bound, config=config
    )


def _make_travelling(modules: int, config: ControllerConfig) -> Controller:
    return _make_knotted("travelling", travelling, "angle", U_SHAPE_HINT, modules, config)


def _make_knotted(
    name: str,
    law: Callable[..., Float[np.ndarray, "P H"]],
    quantity: str,
    initial: tuple[float, ...],
    modules: int,
    config: ControllerConfig,
) -> Controller:
    """Make a controller whose genes are values of a quantity at knots along the course."""
    knots = config.knots
    return Controller(
        name=name,
        modules=modules,
        parameters=tuple(f"{quantity}_at_{100 * x:+.0f}_cm" for x in knots),
        law=partial(law, knots=knots),
        initial=initial,
        bound=config.gene_bound,
        sensors=(*SENSORS, "track_odometry"),
        config=config,
    )


def _make_posture(modules: int, config: ControllerConfig) -> Controller:
    hinges = tuple(f"hinge_{index}" for index in range(modules - 1))
    initial = (0.0,) * len(hinges)
    return Controller("posture", modules, hinges, posture, initial, bound=config.gene_bound, config=config)


def _make_network(modules: int, config: ControllerConfig) -> Controller:
    units = range(config.num_hidden)
    weights = tuple(f"hidden_{unit}_{name}" for unit in units for name in NETWORK_INPUTS)
    weights += (*(f"output_{unit}" for unit in units), "output_bias")
    return Controller(
        name="network",
        modules=modules,
        parameters=weights,
        law=partial(network, num_hidden=config.num_hidden),
        initial=(0.0,) * len(weights),
        bound=config.weight_bound,
        config=config,
    )


_MAKERS: dict[str, Callable[[int, ControllerConfig], Controller]] = {
    "path": _make_path,
    "reactive": _make_reactive,
    "travelling": _make_travelling,
    "posture": _make_posture,
    "network": _make_network,
}
CONTROLLERS = tuple(_MAKERS)
"""Names of the controllers."""
