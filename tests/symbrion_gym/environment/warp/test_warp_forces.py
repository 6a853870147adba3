"""What forces differ by between the engines: what distances of contacts do where coordinates have 32 bits."""

from typing import Any

import mujoco
import numpy as np
import pytest

from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.warp.batch import WarpBatch

pytest.importorskip("mujoco_warp", reason="needs the extra gpu")
pytestmark = pytest.mark.slow

NUM, STEPS = 4, 60


def step_by_hand(model: Any, data: Any, rng: Any) -> None:
    """Take a physics step of the C engine; with `rng`, distances of contacts are as fine as 32-bit coordinates."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_tendon(model, data)
    mujoco.mj_makeM(model, data)
    mujoco.mj_factorM(model, data)
    mujoco.mj_collision(model, data)
    if rng is not None and data.ncon:
        farthest = np.abs(data.contact.pos).max(axis=1).astype(np.float32)
        data.contact.dist[:] += rng.uniform(-0.5, 0.5, data.ncon) * np.spacing(farthest)
    mujoco.mj_makeConstraint(model, data)
    mujoco.mj_transmission(model, data)
    mujoco.mj_island(model, data)
    mujoco.mj_projectConstraint(model, data)
    mujoco.mj_sensorPos(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_sensorVel(model, data)
    mujoco.mj_fwdActuation(model, data)
    mujoco.mj_fwdAcceleration(model, data)
    mujoco.mj_fwdConstraint(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    mujoco.mj_sensorAcc(model, data)
    mujoco.mj_implicit(model, data)


@pytest.fixture(scope="module")
def start():
    """A model, and bodies that have just been laid down."""
    envs = OrganismVectorEnv(NUM, 1, "Disabled", modules=4, start="pit", pit=0.3)
    envs.reset(seed=0, options={"yaw": (-0.1, 0.1)})
    return envs.model, envs.batch.bind("qpos").copy()


def run_c(start: Any, rng: Any = None) -> dict[str, np.ndarray]:
    """Return what the C engine finds in every step: velocities and readings, within the range of the sensors."""
    model, qpos = start
    found: dict[str, list[np.ndarray]] = {"qvel": [], "sensordata": []}
    states = [mujoco.MjData(model) for _ in qpos]
    for data, own in zip(states, qpos, strict=True):
        data.qpos[:] = own
    for _ in range(STEPS):
        for data in states:
            step_by_hand(model, data, rng)
        for name, values in found.items():
            values.append(np.array([getattr(data, name) for data in states]))
    return {name: np.array(values) for name, values in found.items()}


def run_warp(start: Any) -> dict[str, np.ndarray]:
    """Return the same of Warp."""
    model, qpos = start
    batch = WarpBatch(model, NUM, "cpu")
    found: dict[str, list[np.ndarray]] = {"qvel": [], "sensordata": []}
    live = {name: batch.bind(name) for name in found}
    batch.bind("qpos")[:] = qpos
    for _ in range(STEPS):
        batch.step()
        for name, values in found.items():
            values.append(live[name].copy())
    return {name: np.array(values) for name, values in found.items()}


def find_columns(model: Any, kind: int) -> np.ndarray:
    ids = np.flatnonzero(model.sensor_type == kind)
    return np.concatenate([model.sensor_adr[i] + np.arange(model.sensor_dim[i]) for i in ids])


def test_forces_differ_by_what_32_bits_make_of_the_distances_of_contacts(start):
    model = start[0]
    exact, rounded, warp = run_c(start), run_c(start, np.random.default_rng(0)), run_warp(start)
    again = mujoco.MjData(model)
    again.qpos[:] = start[1][0]
    for _ in range(STEPS):
        mujoco.mj_step(model, again)
    np.testing.assert_array_equal(exact["qvel"][-1, 0], again.qvel, "the pieces are those of mj_step")
    touch = find_columns(model, mujoco.mjtSensor.mjSENS_TOUCH)
    acceleration = find_columns(model, mujoco.mjtSensor.mjSENS_ACCELEROMETER)
    for name, columns in (("qvel", slice(None)), ("sensordata", touch), ("sensordata", acceleration)):
        one, two, three = (each[name][..., columns] for each in (exact, rounded, warp))
        in_range = (
            np.abs(one) < 39.0
        )  # C cuts readings off, and Warp leaves that to the bounds of the observation
        here, there = (np.median(np.abs(each - one)[in_range & (one != 0.0)]) for each in (two, three))
        assert 0.0 < here < 1e-3
        assert 0.3 < there / here < 3.0
