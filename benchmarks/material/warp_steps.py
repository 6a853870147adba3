"""Physics steps of random controllers on MuJoCo's C engine, on MuJoCo Warp, and on the C engine with rounded states.

The third tells what single precision of the state alone makes of the same engine: after every step, positions,
velocities and the warm start of its solver are rounded to 32 bits. A fourth run begins a little beside its start: from
when on the same engine disagrees with itself about contacts, and what follows from that.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np

from benchmarks.material.crossings import draw_conditions
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.randomization import VARIED
from symbrion_gym._src.environment.warp.batch import WarpEngine
from symbrion_gym._src.environment.world import World

STEPS_PER_ACTION = 100
"""Random actions are held for so long: half a second."""
CLOSE = 1e-4
"""Differences of qpos below this count as none [m], [rad]."""
Pairs = tuple[tuple[int, int], ...]
"""Geoms that touch, sorted; a pair with several contacts occurs as often."""


class Moment(NamedTuple):
    """All simulations after a physics step.

    Attributes:
        qpos: `[N, nq]`.
        pairs: contacts of each simulation.
    """

    qpos: np.ndarray
    pairs: list[Pairs]


class Setting(NamedTuple):
    """Simulations that begin, and what drives them.

    Attributes:
        world: compiled arena with an organism.
        fields: values of `VARIED` in every simulation.
        qpos: `[N, nq]` at the start.
        control: `[T, N, nu]` of every physics step.
    """

    world: World
    fields: dict[str, np.ndarray]
    qpos: np.ndarray
    control: np.ndarray


def make_setting(arena: str, controllers: int, steps: int, seed: int = 0, **options: Any) -> Setting:
    """Return random controllers under random conditions; servos run at their speed."""
    rng = np.random.default_rng(seed)
    envs = OrganismVectorEnv(controllers, 1, "Disabled", arena=arena, **options)
    envs.reset(seed=seed, options=draw_conditions(rng, controllers))
    fields = {name: envs.batch.expand(name).copy() for name in VARIED}
    qpos, control = envs.batch.bind("qpos").copy(), []
    skip = envs.config.frame_skip
    live = envs.batch.bind("ctrl")
    for tick in range(steps // skip):
        if tick % (STEPS_PER_ACTION // skip) == 0:
            actions = rng.uniform(-1.0, 1.0, envs.action_space.shape)
        envs.step(actions)
        control += [live.copy()] * skip
    envs.close()
    return Setting(envs.world, fields, qpos, np.array(control))


def run_reference(setting: Setting, is_rounded: bool = False, offset: float = 0.0) -> Iterator[Moment]:
    """Yield the steps of the C engine.

    Args:
        setting: simulations.
        is_rounded: whether what is kept from step to step is rounded to 32 bits.
        offset: standard deviation of what is added to the heights and the angles of the hinges at the start [m], [rad].
    """
    count, rng = len(setting.qpos), np.random.default_rng(0)
    models = [setting.world.model.__copy__() for _ in range(count)]
    states = [mujoco.MjData(model) for model in models]
    for row, (model, data) in enumerate(zip(models, states, strict=True)):
        for name, values in setting.fields.items():
            getattr(model, name)[:] = values[row]
        data.qpos[:] = setting.qpos[row]
        if offset:
            data.qpos[2] += rng.normal(0.0, offset)
            data.qpos[7:] += rng.normal(0.0, offset, len(data.qpos) - 7)
        if is_rounded:
            _round(data)
    for control in setting.control:
        for model, data, own in zip(models, states, control, strict=True):
            data.ctrl[:] = own
            mujoco.mj_step(model, data)
            if is_rounded:
                _round(data)
        pairs = [_sort(data.contact.geom) for data in states]
        yield Moment(np.array([data.qpos for data in states]), pairs)


def _round(data: mujoco.MjData) -> None:
    for name in ("qpos", "qvel", "qacc_warmstart"):
        values = getattr(data, name)
        values[:] = values.astype(np.float32)


def run_warp(setting: Setting, device: str) -> Iterator[Moment]:
    """Yield the steps of Warp."""
    count = len(setting.qpos)
    engine = WarpEngine(count, device)
    engine.add(setting.world)
    engine.build()
    for name, values in setting.fields.items():
        engine.write(name, values)
    qpos, control = engine.bind("qpos"), engine.bind("ctrl")
    qpos[:] = setting.qpos
    for each in setting.control:
        control[:] = each
        engine.step()
        found, contact = int(engine._data.nacon.numpy()[0]), engine._data.contact
        geoms, worlds = contact.geom.numpy()[:found].reshape(-1, 2), contact.worldid.numpy()[:found]
        yield Moment(qpos.copy(), [_sort(geoms[worlds == row]) for row in range(count)])


def _sort(geoms: np.ndarray) -> Pairs:
    return tuple(sorted((int(min(pair)), int(max(pair))) for pair in geoms))


def find_same(reference: list[Moment], other: list[Moment]) -> np.ndarray:
    """Return `[T, N]` whether the same geoms have touched up to each step."""
    moments = zip(reference, other, strict=True)
    same = [[a == b for a, b in zip(one.pairs, two.pairs, strict=True)] for one, two in moments]
    return np.logical_and.accumulate(np.array(same), axis=0)


def compare(reference: list[Moment], other: list[Moment]) -> dict[str, Any]:
    """Return by how much positions differ while the same geoms touch, and over all steps."""
    before = find_same(reference, other)
    difference = np.array(
        [np.abs(a.qpos - b.qpos).max(axis=1) for a, b in zip(reference, other, strict=True)]
    )
    largest = np.where(before, difference, 0.0).max(axis=0)
    return {
        "steps": len(reference),
        "controllers": len(largest),
        "steps_of_same_contacts": float(before.sum(axis=0).mean()),
        "within_1e-4": int((largest < CLOSE).sum()),
        "largest": float(largest.max()),
        "median": float(np.median(largest)),
        "largest_of_all_steps": float(difference.max()),
        "within_1e-4_of_all_steps": int((difference.max(axis=0) < CLOSE).sum()),
    }
