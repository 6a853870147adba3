"""Random commands for robots in a pen: nothing diverges, gets lost, overlaps or moves by itself, at any fidelity."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.swarm.docks import DockConfig, find_groups
from symbrion_gym._src.swarm.dynamic.motion import Motion, find_kinetic_energy
from symbrion_gym._src.swarm.dynamic.transfer import read_motion
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.fidelity import make_world
from symbrion_gym._src.swarm.kinematic.collisions import find_outlines, find_overlaps, find_pairs, take
from symbrion_gym._src.swarm.kinematic.rotations import find_headings
from symbrion_gym._src.swarm.mixed import MixedWorld
from symbrion_gym._src.swarm.world import SwarmCommands, SwarmWorld

NUM_ROBOTS = 8
STEPS = 1_000_000
"""Decisions of single robots."""
NUM_RUNS = 40
PENS = {"kinematic": 0.8, "mixed": 1.4, "dynamic": 0.8}
"""Fidelity and inner edge of its pen [m]: small, so that robots meet; wider where some are to stay kinematic."""
DOCKS = DockConfig(distance=0.02, offset=0.02, height=0.02, angle=25.0, roll=25.0)
"""Twice as tolerant as usual and more, so that random robots latch."""
DEEPEST = 0.02
"""Deeper contacts count as two bodies in one place [m]."""
NEAREST = 0.06
"""So do centers of modules that are nearer than this [m]: little more than half of a module."""
ENERGY_GAIN = 1e-3
"""Energy that robots at rest gain by rounding and by contacts that yield, at most, in a decision [J]."""
_WALL, _THICKNESS = 0.4, 0.1
_CHANGE, _IDLE_EVERY, _IDLE, _SETTLE = 15, 400, 50, 15
"""Decisions: between new commands; between pauses; of a pause, longer than an arm takes to fold; of it until nothing
mates any more."""
_LATCH_CHANGE = 90
"""Decisions between new commands for the docks: in between, robots may become one body, then a larger one."""
_X, _Y = (-0.2, -0.067, 0.066, 0.199), (-0.067, 0.066)
"""Places at the start of a run [m]: two rows in which docks are within reach of each other on all sides."""
_GRAVITY = 9.81


@dataclass
class Findings:
    """What was seen.

    Attributes:
        steps: decisions of single robots.
        not_finite: states with a number that is not finite.
        lost: robots beyond the pen.
        deepest: deepest contact between robots, or of a robot with the ground [m]; of kinematic robots, that of the
            discs and arms that stand for them.
        nearest: smallest distance of two centers [m].
        gain: largest gain of energy in a decision of a pause in which no servo moves [J].
        rests: how many such decisions there were.
        conversion_gain: largest gain of kinetic energy where the model changed [J].
        latched: how many times docks latched.
        conversions: how many times the model changed.
        largest_group: of docked robots.
        fastest: largest speed of a module [m/s].
        kinematic_share: of robots, in the mean.
    """

    steps: int = 0
    not_finite: int = 0
    lost: int = 0
    deepest: float = 0.0
    nearest: float = np.inf
    gain: float = -np.inf
    conversion_gain: float = -np.inf
    latched: int = 0
    conversions: int = 0
    largest_group: int = 1
    fastest: float = 0.0
    kinematic_share: float = 0.0
    rests: int = 0
    seen: set[Any] = field(default_factory=set)


def make_pen(size: float = PENS["dynamic"]) -> Arena:
    """Return a level floor with a wall around it."""
    half, wide = size / 2, size / 2 + _THICKNESS
    boxes = [((-wide, -wide, -_THICKNESS), (wide, wide, 0.0))]
    boxes += [((sign * wide, -wide, 0.0), (sign * half, wide, _WALL)) for sign in (-1.0, 1.0)]
    boxes += [((-half, sign * wide, 0.0), (half, sign * half, _WALL)) for sign in (-1.0, 1.0)]
    pieces = [trimesh.creation.box(bounds=np.sort(np.array(box), axis=0)) for box in boxes]
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=len(pieces))
    surface = trimesh.util.concatenate(pieces)
    assert isinstance(surface, trimesh.Trimesh)
    return Arena(name="pen", pieces=pieces, surface=surface, quality=quality)


def measure_random(quick: bool) -> dict[str, Any]:
    """Step robots at random at every fidelity and return the worst of what was seen."""
    found = {fidelity: measure_fidelity(fidelity, quick) for fidelity in PENS}
    return {**found, "missed": any(each["missed"] for each in found.values())}


def measure_fidelity(fidelity: str, quick: bool) -> dict[str, Any]:
    """Step robots at random at one fidelity and return the worst of what was seen."""
    begun, found = time.process_time(), Findings()
    num_runs = 4 if quick else NUM_RUNS
    for seed in range(num_runs):
        run_random(fidelity, seed, (20_000 if quick else STEPS) // num_runs, found)
        print(
            fidelity,
            seed,
            {name: value for name, value in vars(found).items() if name != "seen"},
            flush=True,
        )
    is_kept = not (found.not_finite or found.lost)
    is_apart = found.deepest <= DEEPEST and found.nearest >= NEAREST
    is_quiet = max(found.gain, found.conversion_gain) <= ENERGY_GAIN
    shown = {name: value for name, value in vars(found).items() if name != "seen"}
    return {
        **{name: value if np.isfinite(value) else None for name, value in shown.items()},
        "layouts": len(found.seen),
        "cpu_s": time.process_time() - begun,
        "missed": not (is_kept and is_apart and is_quiet),
    }


def run_random(fidelity: str, seed: int, steps: int, found: Findings) -> SwarmWorld:
    """Step one pen of robots until `steps` decisions of single robots are done."""
    pen = PENS[fidelity]
    world = make_world(make_pen(pen), NUM_ROBOTS, fidelity, docks=DOCKS)
    rng = np.random.default_rng([21, seed])
    places = np.array([[x, y, 0.0] for y in _Y for x in _X])
    world.reset(places + rng.uniform(-1.0, 1.0, places.shape) * [0.001, 0.002, np.deg2rad(1.5)], seed)
    commands = draw_commands(rng)
    for decision in range(steps // NUM_ROBOTS):
        if decision % _CHANGE == 0:
            new = draw_commands(rng)
            is_told = decision % _LATCH_CHANGE == 0
            commands = new if is_told else new._replace(latch=commands.latch)
        step(world, commands, found, pen)
        found.steps += NUM_ROBOTS
        share = 1.0 - len(find_dynamic(world)[1]) / NUM_ROBOTS
        found.kinematic_share += (share - found.kinematic_share) * NUM_ROBOTS / found.steps
        if decision % _IDLE_EVERY == _IDLE_EVERY - 1:
            _pause(world, commands, found, pen)
    return world


def draw_commands(rng: np.random.Generator) -> SwarmCommands:
    """Return random commands: half of the robots drive ahead, most docks latch."""
    tracks = rng.uniform(-0.1, 0.1, (NUM_ROBOTS, 2))
    ahead = rng.random(NUM_ROBOTS) < 0.5
    tracks[ahead] = tracks[ahead].mean(axis=1, keepdims=True)
    hinge = rng.uniform(-1.5, 1.5, NUM_ROBOTS) * (rng.random(NUM_ROBOTS) < 0.5)
    return SwarmCommands(tracks, hinge, rng.random((NUM_ROBOTS, 4)) < 0.85)


def find_dynamic(world: SwarmWorld) -> tuple[DynamicWorld | None, tuple[int, ...]]:
    """Return the dynamic world in a world, and which robots are in it."""
    if isinstance(world, MixedWorld):
        return world.dynamic, world.robots
    if isinstance(world, DynamicWorld):
        return world, tuple(range(world.num_robots))
    return None, ()


def step(world: SwarmWorld, commands: SwarmCommands, found: Findings, pen: float) -> None:
    """Step once and note what is seen."""
    before, links = find_conversion(world), set(world.state.links)
    world.step(commands)
    state = world.state
    found.latched += len(set(state.links) - links)
    if not all(np.isfinite(each).all() for each in (*state[:5], state.load, state.odometry)):
        found.not_finite += 1
        return
    outside = np.abs(state.position[:, :2]).max(axis=1) > pen / 2
    found.lost += int(np.count_nonzero(outside | (state.position[:, 2] < 0.0) | (state.position[:, 2] > 1.5)))
    apart = np.linalg.norm(state.position[:, None] - state.position[None], axis=-1)
    found.nearest = min(found.nearest, float(apart[np.triu_indices(len(apart), 1)].min()))
    found.deepest = max(found.deepest, find_depth(world))
    found.fastest = max(found.fastest, float(np.linalg.norm(state.velocity, axis=1).max()))
    groups = find_groups(state.links, world.num_robots)
    found.largest_group = max(found.largest_group, int(np.bincount(groups).max()))
    dynamic, now = find_dynamic(world)[0], find_conversion(world)
    if dynamic is not None:
        found.seen.add(dynamic.assembly.layout)
    if now is not before and now is not None:
        energies = [find_kinetic_energy(motion, world.scout).sum() for motion in now]
        found.conversion_gain = max(found.conversion_gain, float(energies[1] - energies[0]))
        found.conversions += 1


def find_conversion(world: SwarmWorld) -> tuple[Motion, Motion] | None:
    """Return how dynamic robots moved before and after the last change of their layout."""
    dynamic = find_dynamic(world)[0]
    return None if dynamic is None else dynamic.conversion


def find_depth(world: SwarmWorld) -> float:
    """Return how deep the deepest contact is: that of MuJoCo, and the overlap of kinematic robots with others [m]."""
    dynamic, robots = find_dynamic(world)
    depth = 0.0 if dynamic is None else -float(dynamic.data.contact.dist.min(initial=0.0))
    state = world.state
    first, second = find_pairs(state.position, 2 * world.scout.arm_reach)
    groups = find_groups(state.links, world.num_robots)
    is_kinematic = ~(np.isin(first, robots) & np.isin(second, robots))
    kept = is_kinematic & (groups[first] != groups[second])
    outlines = find_outlines(state.position, find_headings(state.rotation), state.hinge, world.scout)
    overlap = find_overlaps(take(outlines, first[kept]), take(outlines, second[kept]), world.scout)
    return max(depth, float(overlap.max(initial=0.0)))


def _pause(world: SwarmWorld, commands: SwarmCommands, found: Findings, pen: float) -> None:
    """Let all stand still and hold their arms; once nothing mates or folds any more, their energy must not grow."""
    still = SwarmCommands(np.zeros((NUM_ROBOTS, 2)), world.state.hinge.copy(), commands.latch)
    energy = np.inf
    for decision in range(_IDLE):
        before = _find_setup(world)
        step(world, still, found, pen)
        if _is_mating(world) or _find_setup(world) != before or decision < _SETTLE:
            energy = np.inf
            continue
        now = find_energy(world)
        if np.isfinite(energy):
            found.gain, found.rests = max(found.gain, now - energy), found.rests + 1
        energy = now


def _find_setup(world: SwarmWorld) -> tuple[Any, ...]:
    """Return what changes when docks, levels of physics or servos do something."""
    dynamic, robots = find_dynamic(world)
    target = None if dynamic is None else dynamic.target.tobytes()
    return world.state.links, robots, target


def _is_mating(world: SwarmWorld) -> bool:
    dynamic = find_dynamic(world)[0]
    return dynamic is not None and bool(dynamic.assembly.layout.welds)


def find_energy(world: SwarmWorld) -> float:
    """Return kinetic energy and, of dynamic robots, that of gravity and what the servos store as springs [J]."""
    dynamic = find_dynamic(world)[0]
    state, still = world.state, np.zeros(world.num_robots)
    if dynamic is None:
        return float(find_kinetic_energy(Motion(*state[:5], still), world.scout).sum())
    motion, model = read_motion(dynamic.assembly, dynamic.data), dynamic.assembly.model
    kinetic = find_kinetic_energy(motion, world.scout).sum()
    height = (model.body_mass * dynamic.data.xipos[:, 2]).sum() * _GRAVITY
    stored = 0.5 * world.scout.hinge_stiffness * ((dynamic.target - motion.hinge) ** 2).sum()
    return float(kinetic + height + stored)
