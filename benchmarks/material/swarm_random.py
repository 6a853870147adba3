"""Random commands for robots in a small pen: nothing diverges, gets lost, overlaps or moves by itself."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.contact.quality import ArenaQuality
from symbrion_gym.swarm.docks import DockConfig
from symbrion_gym.swarm.dynamic.motion import find_kinetic_energy
from symbrion_gym.swarm.dynamic.transfer import read_motion
from symbrion_gym.swarm.dynamic.world import DynamicWorld
from symbrion_gym.swarm.world import SwarmCommands

NUM_ROBOTS = 8
STEPS = 1_000_000
"""Decisions of single robots."""
NUM_RUNS = 40
PEN = 0.8
"""Inner edge of the pen [m]: small, so that robots meet."""
DOCKS = DockConfig(distance=0.02, offset=0.02, height=0.02, angle=25.0, roll=25.0)
"""Twice as tolerant as usual and more, so that random robots latch."""
DEEPEST = 0.02
"""Deeper contacts count as two bodies in one place [m]."""
NEAREST = 0.06
"""So do centers of modules that are nearer than this [m]: little more than half of a module."""
ENERGY_GAIN = 1e-3
"""Energy that robots at rest gain by rounding and by contacts that yield, at most, in a decision [J]."""
_WALL, _THICKNESS = 0.4, 0.1
_CHANGE, _IDLE_EVERY, _IDLE, _SETTLE = 15, 400, 25, 15
"""Decisions: between new commands; between pauses; of a pause; of it until nothing mates any more."""
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
        deepest: deepest contact between robots, or of a robot with the ground [m].
        nearest: smallest distance of two centers [m].
        gain: largest gain of energy in a decision of a pause [J].
        conversion_gain: largest gain of kinetic energy where the model changed [J].
        latched: how many times docks latched.
        conversions: how many times the model changed.
        largest_group: of docked robots.
        fastest: largest speed of a module [m/s].
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
    seen: set[Any] = field(default_factory=set)


def make_pen(size: float = PEN) -> Arena:
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
    """Step robots at random and return the worst of what was seen."""
    begun, found = time.process_time(), Findings()
    num_runs = 4 if quick else NUM_RUNS
    for seed in range(num_runs):
        run_random(seed, (20_000 if quick else STEPS) // num_runs, found)
        print(seed, {name: value for name, value in vars(found).items() if name != "seen"}, flush=True)
    is_kept = not (found.not_finite or found.lost)
    is_apart = found.deepest <= DEEPEST and found.nearest >= NEAREST
    is_quiet = max(found.gain, found.conversion_gain) <= ENERGY_GAIN
    return {
        **{name: value for name, value in vars(found).items() if name != "seen"},
        "layouts": len(found.seen),
        "cpu_s": time.process_time() - begun,
        "missed": not (is_kept and is_apart and is_quiet),
    }


def run_random(seed: int, steps: int, found: Findings) -> DynamicWorld:
    """Step one pen of robots until `steps` decisions of single robots are done."""
    world = DynamicWorld(make_pen(), NUM_ROBOTS, docks=DOCKS)
    rng = np.random.default_rng([21, seed])
    places = np.array([[x, y, 0.0] for y in _Y for x in _X])
    world.reset(places + rng.uniform(-1.0, 1.0, places.shape) * [0.001, 0.002, np.deg2rad(1.5)])
    commands = draw_commands(rng)
    for decision in range(steps // NUM_ROBOTS):
        if decision % _CHANGE == 0:
            new = draw_commands(rng)
            is_told = decision % _LATCH_CHANGE == 0
            commands = new if is_told else new._replace(latch=commands.latch)
        _step(world, commands, found)
        found.steps += NUM_ROBOTS
        if decision % _IDLE_EVERY == _IDLE_EVERY - 1:
            _pause(world, commands, found)
    return world


def draw_commands(rng: np.random.Generator) -> SwarmCommands:
    """Return random commands: half of the robots drive ahead, most docks latch."""
    tracks = rng.uniform(-0.1, 0.1, (NUM_ROBOTS, 2))
    ahead = rng.random(NUM_ROBOTS) < 0.5
    tracks[ahead] = tracks[ahead].mean(axis=1, keepdims=True)
    hinge = rng.uniform(-1.5, 1.5, NUM_ROBOTS) * (rng.random(NUM_ROBOTS) < 0.5)
    return SwarmCommands(tracks, hinge, rng.random((NUM_ROBOTS, 4)) < 0.85)


def _step(world: DynamicWorld, commands: SwarmCommands, found: Findings) -> None:
    before, links = world.conversion, set(world.state.links)
    world.step(commands)
    state = world.state
    found.latched += len(set(state.links) - links)
    if not all(np.isfinite(each).all() for each in (*state[:5], state.load)):
        found.not_finite += 1
        return
    outside = np.abs(state.position[:, :2]).max(axis=1) > PEN / 2
    found.lost += int(np.count_nonzero(outside | (state.position[:, 2] < 0.0) | (state.position[:, 2] > 1.5)))
    apart = np.linalg.norm(state.position[:, None] - state.position[None], axis=-1)
    found.nearest = min(found.nearest, float(apart[np.triu_indices(len(apart), 1)].min()))
    found.deepest = max(found.deepest, -float(world.data.contact.dist.min(initial=0.0)))
    found.fastest = max(found.fastest, float(np.linalg.norm(state.velocity, axis=1).max()))
    if world.conversion is not before and world.conversion is not None:
        energies = [find_kinetic_energy(motion, world.scout).sum() for motion in world.conversion]
        found.conversion_gain = max(found.conversion_gain, float(energies[1] - energies[0]))
        found.conversions += 1
        layout = world.assembly.layout
        found.seen.add(layout)
        found.largest_group = max(found.largest_group, *(len(tree.robots) for tree in layout.trees))


def _pause(world: DynamicWorld, commands: SwarmCommands, found: Findings) -> None:
    """Let all stand still and hold their arms; after a while their energy must not grow."""
    still = SwarmCommands(np.zeros((NUM_ROBOTS, 2)), world.target.copy(), commands.latch)
    energy = np.inf
    for decision in range(_IDLE):
        links = world.state.links
        _step(world, still, found)
        if world.assembly.layout.welds or world.state.links != links or decision < _SETTLE:
            energy = np.inf
            continue
        now = find_energy(world)
        if np.isfinite(energy):
            found.gain = max(found.gain, now - energy)
        energy = now


def find_energy(world: DynamicWorld) -> float:
    """Return kinetic energy, potential energy of gravity, and what the servos store as springs [J]."""
    motion = read_motion(world.assembly, world.data)
    kinetic = find_kinetic_energy(motion, world.scout).sum()
    model = world.assembly.model
    height = (model.body_mass * world.data.xipos[:, 2]).sum() * _GRAVITY
    stored = 0.5 * world.scout.hinge_stiffness * ((world.target - motion.hinge) ** 2).sum()
    return float(kinetic + height + stored)
