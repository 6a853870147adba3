"""Energy, rest and touching: balances read from MuJoCo's raw state, step by step."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from benchmarks.material.physics_worlds import Bench, World
from symbrion_gym._src.environment.organism_env import OrganismEnv

CREEP_SECONDS = 10.0
TWITCH_CYCLES = 15
_SETTLING = 1.0
"""Time to come to rest before anything is measured [s]."""
_TICK = 0.02
"""Time between two targets of the hinges [s]."""
_WAVE = 0.25
"""Height of the wave that runs through the hinges while energy is measured [rad]."""


class Energy(NamedTuple):
    """What went into a robot over some time, and where it went [J].

    Attributes:
        hinges: work of the servos of the hinges.
        tracks: work of the tracks.
        stored: growth of potential and kinetic energy.
        sliding: lost to friction, against the sliding of the belts' surfaces.
        impact: lost across the surfaces of contacts.
        damping: lost in the joints.
    """

    hinges: float
    tracks: float
    stored: float
    sliding: float
    impact: float
    damping: float

    @property
    def residual(self) -> float:
        """What is not accounted for, as a share of the work done and lost."""
        paid = self.hinges + self.tracks
        spent = self.stored + self.sliding + self.impact + self.damping
        return abs(paid - spent) / max(abs(self.hinges) + abs(self.tracks), 1e-9)


def measure_energy(world: World, slope: float, seconds: float = 4.0, speed: float = 0.1) -> Energy:
    """Return the energy balance of a robot that drives up a slope while a wave runs through its hinges.

    Forces of a step act over the mean of the velocities before and after it. The servo's gain on the rate and the
    damping of joints act on the velocity after it, as the integrator has it.
    """
    bench = Bench(world, slope=slope)
    bench.step(0.3)
    bench.start(speed)
    model, data, total = bench.model, bench.data, np.zeros(5)
    start = find_energy(model, data)
    for step in range(round(seconds / model.opt.timestep)):
        phase = 2 * np.pi * 0.5 * step * model.opt.timestep
        height = _WAVE * min(step * model.opt.timestep, 1.0)
        data.ctrl[:] = height * np.sin(phase - 0.8 * np.arange(model.nu))
        total += _measure_step(bench)
    stored = find_energy(model, data) - start
    return Energy(total[0], total[1], stored, *total[2:])


def find_energy(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return potential and kinetic energy [J], with the inertia of the motors."""
    state = mujoco.MjData(model)
    state.qpos[:], state.qvel[:] = data.qpos, data.qvel
    mujoco.mj_forward(model, state)
    momentum = np.zeros(model.nv)
    mujoco.mj_mulM(model, state, momentum, state.qvel)
    return float(0.5 * momentum @ state.qvel - model.body_mass @ (state.xipos @ model.opt.gravity))


def _measure_step(bench: Bench) -> Float[np.ndarray, 5]:
    """Step once and return the work of hinges and tracks, and the losses of sliding, impact and damping [J]."""
    model, data, dt = bench.model, bench.data, bench.model.opt.timestep
    before = data.qvel.copy()
    mujoco.mj_step(model, data)
    mean, change = (before + data.qvel) / 2, data.qvel - before
    dof = model.jnt_dofadr[model.actuator_trnid[:, 0]]
    force, gain = data.actuator_force.copy(), model.actuator_biasprm[:, 2]
    limit = np.where(model.actuator_forcelimited.astype(bool), model.actuator_forcerange[:, 1], np.inf)
    force += np.where(np.abs(force) < limit * (1 - 1e-9), gain * change[dof], 0.0)
    work = force * mean[dof] * dt
    sliding, impact, belts = _measure_contacts(model, data, mean)
    damping = (model.dof_damping * data.qvel) @ mean
    return np.array([work.sum(), belts * dt, sliding * dt, impact * dt, damping * dt])


def _measure_contacts(
    model: mujoco.MjModel, data: mujoco.MjData, velocity: np.ndarray
) -> tuple[float, float, float]:
    """Return the power lost to sliding and across contacts, and that of the belts [W]."""
    sliding, impact, belts, wrench = 0.0, 0.0, 0.0, np.zeros(6)
    ends = (np.zeros((3, model.nv)), np.zeros((3, model.nv)))
    for index in range(data.ncon):
        contact = data.contact[index]
        mujoco.mj_contactForce(model, data, index, wrench)
        if not wrench[0]:
            continue
        axes = contact.frame.reshape(3, 3)
        surface = np.zeros(3)
        for sign, geom, jacobian in zip((-1.0, 1.0), contact.geom, ends, strict=True):
            mujoco.mj_jac(model, data, jacobian, None, contact.pos, model.geom_bodyid[geom])
            turn = data.geom_xmat[geom].reshape(3, 3) @ model.geom_surfacevel[geom, 3:]
            surface += sign * np.cross(turn, contact.pos - data.geom_xpos[geom])
        body = axes @ ((ends[1] - ends[0]) @ velocity)
        belt = axes @ surface
        belts -= wrench[1:3] @ belt[1:]
        sliding -= wrench[1:3] @ (body + belt)[1:]
        impact -= wrench[0] * body[0]
    return sliding, impact, belts


def measure_creep(world: World, slope: float = 0.0) -> float:
    """Return the speed at which a robot moves with its tracks off and its hinges still [m/s]."""
    bench = Bench(world, slope=slope)
    bench.step(_SETTLING)
    before = bench.places.mean(axis=0)
    bench.step(CREEP_SECONDS)
    return float(np.linalg.norm(bench.places.mean(axis=0) - before)) / CREEP_SECONDS


def measure_twitching(world: World, height: float, frequency: float, cycles: int = TWITCH_CYCLES) -> float:
    """Return how far a robot moves in a cycle when neighboring hinges swing in opposite phase, tracks off [m].

    Args:
        world: robot and options.
        height: of the swing [rad].
        frequency: of the swing [1/s].
        cycles: number of cycles.
    """
    bench = Bench(world)
    bench.step(_SETTLING)
    before, signs = bench.places.mean(axis=0), (-1.0) ** np.arange(bench.model.nu)
    for tick in range(round(cycles / frequency / _TICK)):
        bench.data.ctrl[:] = height * np.sin(2 * np.pi * frequency * tick * _TICK) * signs
        bench.step(_TICK)
    bench.data.ctrl[:] = 0.0
    bench.step(_SETTLING)
    return float(np.linalg.norm((bench.places.mean(axis=0) - before)[:2])) / cycles


class Depths(NamedTuple):
    """How deep bodies penetrate each other at rest and at worst [m]; force between modules at the end [N]."""

    between_modules: float
    worst_between_modules: float
    ground: float
    force: float


def measure_depths(world: World, angle: float = 1.45, seconds: float = 6.0) -> Depths:
    """Return how deep modules that are curled up into each other penetrate, by hinges at full torque.

    Args:
        world: robot and options; four modules or more.
        angle: target of all hinges [rad].
        seconds: time in which they get there; as long again they press.
    """
    bench = Bench(world)
    bench.step(0.3)
    ticks, worst = round(seconds / _TICK), 0.0
    depths, force = np.zeros(2), 0.0
    for tick in range(2 * ticks):
        bench.data.ctrl[:] = angle * min(tick / ticks, 1.0)
        bench.step(_TICK)
        depths, force = _find_depths(bench)
        worst = max(worst, depths[0])
    return Depths(float(depths[0]), float(worst), float(depths[1]), force)


class Sinking(NamedTuple):
    """How deep a robot sank into its arena at worst [m], and the largest speed of its head [m/s]."""

    deepest: float
    fastest: float


def measure_sinking(friction: float, episodes: int = 6, seconds: float = 20.0) -> Sinking:
    """Return how deep a snake of 8 sinks into the course, whose actions are drawn anew every half second.

    Episodes begin on the floor and before the pit in turn.
    """
    envs = [OrganismEnv(modules=8, friction=friction, start=start) for start in ("floor", "pit")]
    deepest, fastest = 0.0, 0.0
    for seed in range(episodes):
        env, rng = envs[seed % 2], np.random.default_rng(seed)
        env.reset(seed=seed)
        action = np.zeros(env.action_space.shape)
        for tick in range(round(seconds / _TICK)):
            if tick % 25 == 0:
                action = rng.uniform(-1.0, 1.0, env.action_space.shape)
            *_, terminated, _, _ = env.step(action)
            contact, fastest = env.data.contact, max(fastest, float(np.linalg.norm(env.data.qvel[:3])))
            is_ground = (env.model.geom_bodyid[contact.geom] == 0).any(axis=1)
            deepest = max(deepest, float(-contact.dist[is_ground].min(initial=0.0)))
            if terminated:
                break
    return Sinking(deepest, fastest)


def _find_depths(bench: Bench) -> tuple[Float[np.ndarray, 2], float]:
    """Return the deepest contact between modules and with the ground [m], and the force between modules [N]."""
    model, data, wrench = bench.model, bench.data, np.zeros(6)
    depths, force = np.zeros(2), 0.0
    for index in range(data.ncon):
        is_ground = model.geom_bodyid[data.contact.geom[index]].min() == 0
        kind = int(is_ground)
        depths[kind] = max(depths[kind], -data.contact.dist[index])
        if not is_ground:
            mujoco.mj_contactForce(model, data, index, wrench)
            force += wrench[0]
    return depths, float(force)
