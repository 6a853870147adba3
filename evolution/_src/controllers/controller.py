"""The laws of this package as controllers: a law, the genotypes it reads, and the memory between ticks.

Laws are plain functions from sensed quantities and genotypes to hinge targets, on any tree of modules. A population
steps as arrays, and the result for one genotype never depends on the others in the batch (element-wise arithmetic
only). Each hinge joins its own module to the one ahead, docked to its front; a positive angle lifts what is ahead. In a
snake, hinge i joins module i, counted from the head, to module i + 1 behind it. The only memory is how long ago each
module last touched the ground, because contact flickers.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from evolution._src.controllers.joints import Drive, Joints, find_joints, find_namespace, make_drive
from evolution._src.controllers.oscillators import OscillatorController
from evolution._src.controllers.protocol import Structure
from evolution._src.errors import RunError
from reconstruction._src.base.range_checks import check_choice

Sensed = Mapping[str, Float[Any, "P _"]]
"""Quantities by name, one column for each module or hinge.

In addition to the sensors of the environment: "inclination_ahead", see `Joints`, and each 1 or 0: "airborne", a module
without ground contact, and "recent_contact", one whose last contact is recent enough to keep a raised posture."""
Law = Callable[[Sensed, Float[Any, "P G"], Joints], Float[Any, "P H"]]
"""From quantities and genotypes to hinge targets [rad]."""

REACTIVE_GENES = ("bias", "head_bias", "tail_bias", "pitch_ahead", "pitch_behind")
REACTIVE_GENES += ("front_air", "rear_air", "head_pitch")
"""Genes of `reactive`, in order."""


def reactive(sensed: Sensed, genotype: Float[Any, "P G"], joints: Joints) -> Float[Any, "P H"]:
    """Bend each hinge by the pitch of the modules it joins, and lift the parts of the body that are in the air.

    Eight genes whatever the body: a bias for all hinges, one more for those of the head and one for those of the ends
    of the tree, gains on the pitch ahead and behind, a posture for a hinge whose part ahead hangs in the air as a
    whole and one where the part behind does, and a gain from the head's pitch to its hinges. In a snake, these parts
    are the modules before the first and behind the last that touches ground.
    """
    bias, head_bias, tail_bias, ahead, behind, front_air, rear_air, head_pitch = genotype.T[:, :, None]
    pitch, touches = sensed["pitch"], 1.0 - sensed["airborne"]
    front = (touches @ joints.ahead_part.T == 0) * sensed["recent_contact"][:, joints.ahead]
    rear = (touches @ ~joints.ahead_part.T == 0) * sensed["recent_contact"][:, joints.own]
    xp = find_namespace(genotype)
    at_head = xp.where(joints.own == 0, pitch[:, :1], sensed["inclination_ahead"])
    target = bias + ahead * sensed["inclination_ahead"]
    target = target + behind * pitch[:, joints.own]
    target = target + front_air * front
    target = target + rear_air * rear
    target = xp.where(joints.is_head, target + (head_bias + head_pitch * at_head), target)
    return xp.where(joints.is_tail, target + tail_bias, target)


def path(
    sensed: Sensed, genotype: Float[Any, "P G"], joints: Joints, knots: Float[Any, " G"], spacing: float
) -> Float[Any, "P H"]:
    """Follow a path over the ground: each module takes the slope that the path has at its place.

    Slopes are joined linearly between knots along the course, 0 beyond them; a hinge takes the difference between the
    slopes of the modules that it joins, as far as it bends along the course. A slope bends the body only locally and
    does not rotate distant parts, so that genes act independently. Positions come from track odometry and pitch.
    """
    xp = find_namespace(genotype)
    half = (0.5 * spacing * xp.cos(sensed["pitch"])).T
    behind = [xp.zeros_like(half[0])] * len(half)
    for module in joints.order:
        parent = joints.parents[module]
        behind[module] = behind[parent] + joints.steps[module] * (half[parent] + half[module])
    slopes = _interpolate(genotype, sensed["track_odometry"] - xp.stack(behind).T, knots)
    return (slopes[:, joints.ahead] - slopes[:, joints.own]) * joints.along


def posture(sensed: Sensed, genotype: Float[Any, "P G"], joints: Joints) -> Float[Any, "P H"]:
    """Keep one constant angle per hinge, in the order of the modules (paper, section III-A: the U shape).

    A body shorter than the genotype's reads its first genes.
    """
    return genotype[:, : len(joints.own)].copy()


def _interpolate(
    genotype: Float[Any, "P G"], places: Float[Any, "P n"], knots: Float[Any, " G"]
) -> Float[Any, "P n"]:
    """Interpolate linearly between evenly spaced knots at places [m]; 0 beyond them."""
    position = (places - knots[0]) / (knots[1] - knots[0])
    xp = find_namespace(genotype)
    padded = xp.pad(genotype, ((0, 0), (1, 1)))
    left = xp.clip(xp.floor(position), -1, len(knots) - 1).astype(int)
    share = xp.clip(position - left, 0.0, 1.0)
    here = xp.take_along_axis(padded, left + 1, axis=1)
    there = xp.take_along_axis(padded, left + 2, axis=1)
    return here + (there - here) * share


if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

CONTROLLERS = ("path", "reactive", "posture", "oscillators")  # Names of the laws
SENSORS = ("hinge_angle", "pitch", "contact")  # Sensors that every law reads
CONTACT_TIMEOUT = 15
"""Ticks without contact after which a module counts as airborne: 0.3 s bridge the flicker of contact; a head that
drives over an edge advances by 2.5 cm meanwhile."""
MAX_AIRBORNE_TICKS = 175
"""Ticks without contact (3.5 s) after which a module no longer keeps its raised posture: without a limit a raised head
would never come down again."""
NUM_KNOTS = 12  # Knots of `path`: 10 cm apart, finer than a module is long
KNOTS = np.linspace(-0.55, 0.55, NUM_KNOTS)
"""Positions of the knots from the middle of the pit [m]: they cover the pit and 0.3 m on either side."""
GENE_BOUND = 1.5  # Largest absolute value of a gene, an angle [rad] or gain: nearly the range of a hinge
REACTIVE_HINT = (-0.1, 0.0, 0.0, -0.1, 0.0, 1.1, 0.0, -0.6)
"""Hint for a search for a reactive law: lift what is in the air in front, keep the head level.
Set by hand, close to what earlier searches had found; a genotype close to it crossed in 14 of 32 trials."""


class State(NamedTuple):
    """The memory of controllers between ticks."""

    # number of ticks since the last contact of each module; 0 while it touches something
    ticks_since_contact: Int[Any, "P n"]


class LawController:
    """A law of ours on a body: it follows `Controller`.

    The genes of the tracks, where these are part of the action, come before those of the law: so a body that is
    shorter than the genotype's reads its first genes. Actions are relative to `hinge_range` [rad].
    """

    version = "1"  # raised when the law acts differently than before

    def __init__(
        self,
        name: str,
        joints: Joints,
        drive: Drive,
        hinge_range: float,
        law: Law,
        genes: Mapping[str, float],
        bound: float = GENE_BOUND,
        sensors: tuple[str, ...] = SENSORS,
    ) -> None:
        self.name, self.joints, self.drive, self.law, self.hinge_range = name, joints, drive, law, hinge_range
        self._law_sensors = (*sensors, "roll") if joints.has_rolls else sensors
        self.sensors = (*self._law_sensors, *drive.sensors)
        self.parameters = (*drive.genes, *genes)
        self.initial = (*drive.genes.values(), *genes.values())
        self.upper = (drive.bound,) * len(drive.genes) + (bound,) * len(genes)
        self.lower = tuple(-value for value in self.upper)

    def begin(self, count: int) -> State:
        """Return the state of `count` controllers before their first observation."""
        return State(np.zeros((count, self.joints.num_modules), dtype=np.int64))

    def act(
        self, observation: Float[Any, "P O"], genotype: Float[Any, "*P G"], structure: Structure, state: State
    ) -> tuple[Float[Any, "P A"], State]:
        """Compute actions in [-1, 1], hinge targets as a share of their range, then track speeds."""
        xp, num_drive = find_namespace(observation), len(self.drive.genes)
        genes = xp.broadcast_to(genotype, (len(observation), len(self.parameters)))
        sensed = {
            name: xp.asarray(observation[:, structure[name]], dtype=float) for name in self._law_sensors
        }
        sensed["hinge_angle"] = sensed["hinge_angle"][:, : len(self.joints.own)]
        sensed["inclination_ahead"] = self.joints.compute_inclination_ahead(
            sensed["pitch"], sensed.get("roll")
        )
        ticks = (state.ticks_since_contact + 1) * (sensed["contact"] <= 0)
        sensed["airborne"] = (ticks > CONTACT_TIMEOUT).astype(float)
        sensed["recent_contact"] = (ticks <= MAX_AIRBORNE_TICKS).astype(float)
        target = self.law(sensed, genes[:, num_drive:], self.joints) / self.hinge_range
        target = xp.minimum(xp.maximum(target, -1.0), 1.0)
        twists = xp.zeros((len(target), self.joints.num_twists))
        tracks = self.drive.act(genes[:, :num_drive], observation, structure)
        return xp.concatenate((target, twists, tracks), axis=1), State(ticks)


OwnController = LawController | OscillatorController  # A controller of this package


def make_law(name: str, organism: "Organism", num_tracks: int = 0) -> OwnController:
    """Make a law of ours for a body."""
    check_choice("controller", name, CONTROLLERS, RunError)
    if not organism.hinges and not num_tracks:
        raise RunError(
            "a module alone has nothing to control; make its tracks part of the action: track_control 'skid'"
        )
    body = find_joints(organism), make_drive(organism, num_tracks, GENE_BOUND), organism.scout.hinge_range
    if name == "oscillators":
        return OscillatorController(*body, organism.scout.twist_range, GENE_BOUND)
    if name == "path":
        genes = [f"slope_at_{100 * x:+.0f}_cm" for x in KNOTS]
        law, sensors = partial(path, knots=KNOTS, spacing=organism.scout.pitch), (*SENSORS, "track_odometry")
        return LawController(name, *body, law, dict.fromkeys(genes, 0.0), sensors=sensors)
    if name == "reactive":
        return LawController(name, *body, reactive, dict(zip(REACTIVE_GENES, REACTIVE_HINT, strict=True)))
    genes = [f"hinge_{index}" for index in range(len(organism.hinges))]
    return LawController(name, *body, posture, dict.fromkeys(genes, 0.0))


def make_controller(name: str, modules: int) -> OwnController:
    """Make a law of ours for a snake; see `make_law`."""
    from symbrion_gym._src.robot.organism import snake

    return make_law(name, snake(modules))
