"""A body of any shape settled on the ground, as if it were let down slowly with all servos loose."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.environment.laying import LIFT
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.state import Scene

_MARGIN = 0.05  # Contacts are foreseen from this distance on [m]
_STEP = 0.02  # A module moves at most this far up or down in an iteration [m], well within the margin
_REACH = 2.0  # Parts of the body move no farther than this many times that [m]
_ROUGHLY = 4e-3  # The body is first settled up to this step [m], put back to its place, and settled again
_TURN_PER_STEP = 5.0
"""Joints turn at most this much per meter of that step [rad/m]: 0.1 rad, where arcs are still nearly straight."""
_SHORTEST_STEP = 2e-4  # The body has settled when no longer step lowers it [m]
_ENOUGH = 1e-5  # Likewise when an iteration lowers its center of mass by less [m]
_MAX_ITERATIONS = 60  # More than any organism on the arenas at hand needs
_PENALTY = 10.0
"""Weight of the deepest overlap against the height of the center of mass: overlaps are removed first."""
_FRICTION = 0.4
"""Share of the weight that holds a module back from sliding: below the friction of any ground, so that it rests."""
_DANGLING = np.pi / 3
"""Hinges bend no farther to either side, so that what hangs over an edge does not fold under it [rad]."""


class _Linearized(NamedTuple):
    """The body in one pose, and how it changes with a small step of what moves, `m` degrees of freedom."""

    qpos: Float[np.ndarray, " nq"]  # the pose
    distance: Float[np.ndarray, " C"]  # distances to the ground [m]
    leaving: Float[np.ndarray, "C m"]  # their change
    height: float  # of the center of mass [m]
    lifting: Float[np.ndarray, " m"]  # its change
    shifting: Float[np.ndarray, "n 3 m"]  # change of the places of the modules' undersides

    def compute_merit(self, gap: float) -> float:
        """Return what is minimized: height of the center of mass, and the deepest overlap."""
        return self.height + _PENALTY * self.compute_overlap(gap)

    def compute_overlap(self, gap: float) -> float:
        """Return how much the smallest distance is below the wanted one [m]."""
        return max(0.0, gap - self.distance.min(initial=gap))


class Settler:
    """Finds the pose of rest of a body with loose joints on the contact geometry of its arena.

    The potential energy is lowered step by step. Each step is a linear program: the center of mass goes down as far as
    the distances to the ground, linear in the step, allow, and where it gains more than friction takes when modules
    slide. Heading stays. In the pose that this ends in, the ground carries the body with no torque of the servos.

    Args:
        model: the arena with the body; copied.
        modules: ids of the sites that mark the modules.
        joints: addresses of the body's joints in qvel.
        half_height: height of a module's center above its underside [m].

    References:
        Fletcher & Sainz de la Maza (1989), Mathematical Programming 43: sequential linear programming with a trust
        region. Mielke (2005), Evolution in rate-independent systems: friction as a cost of each step.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        modules: Int[np.ndarray, " n"],
        joints: Int[np.ndarray, " h"],
        half_height: float,
    ) -> None:
        self._model = model.__copy__()
        self._data = mujoco.MjData(self._model)
        self._modules = modules
        self._root = int(self._model.body_rootid[self._model.site_bodyid[modules[0]]])
        is_ours = self._model.body_rootid == self._root
        self._model.geom_margin[is_ours[self._model.geom_bodyid]] = _MARGIN
        self._model.body_margin[is_ours] = _MARGIN
        free = int(self._model.jnt_dofadr[self._model.body_jntadr[self._root]])
        self._half_height = half_height
        self._moving = np.array([free, free + 1, free + 2, free + 3, free + 4, *joints])
        joint = self._model.dof_jntid[joints]
        self._qpos = self._model.jnt_qposadr[joint]
        self._limit = np.minimum(self._model.jnt_range[joint, 1], _DANGLING)

    def settle(self, qpos: Float[np.ndarray, " nq"], gap: float) -> Float[np.ndarray, " nq"]:
        """Return the pose of rest below a pose above the ground."""
        above = qpos.copy()
        above[2] += self._linearize(qpos).compute_overlap(gap)
        rough = self._lower(above, gap, _ROUGHLY)
        rough[:2] = qpos[:2]
        return self._lower(rough, gap, _SHORTEST_STEP)

    def _lower(self, qpos: Float[np.ndarray, " nq"], gap: float, shortest: float) -> Float[np.ndarray, " nq"]:
        """Return the pose of rest, up to a shortest step; the root has moved as far as the body has tilted."""
        step, best = _STEP, self._linearize(qpos)
        for _ in range(_MAX_ITERATIONS):
            trial, (change, lost) = best.qpos.copy(), self._find_step(best, step, gap)
            mujoco.mj_integratePos(self._model, trial, change, 1.0)
            tried = self._linearize(trial)
            gained = best.compute_merit(gap) - tried.compute_merit(gap) - lost
            best = tried if gained > 0.0 else best
            step = step / 2 if gained < _ENOUGH else step
            if step < shortest:
                break
        best.qpos[2] += best.compute_overlap(gap)
        return best.qpos

    def _linearize(self, qpos: Float[np.ndarray, " nq"]) -> _Linearized:
        """Move the body and return its distances to the ground and how all changes."""
        model, data, moving = self._model, self._data, self._moving
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        bodies = model.geom_bodyid[data.contact.geom]
        is_ours = model.body_rootid[bodies] == self._root
        found = np.flatnonzero(is_ours.sum(axis=1) == 1)
        jacobian = np.zeros((3, model.nv))
        leaving = np.zeros((len(found), len(moving)))
        for row, contact in enumerate(found.tolist()):
            second = int(is_ours[contact, 1])
            mujoco.mj_jac(
                model, data, jacobian, None, data.contact.pos[contact], int(bodies[contact, second])
            )
            leaving[row] = (2 * second - 1) * data.contact.frame[contact, :3] @ jacobian[:, moving]
        shifting = np.zeros((len(self._modules), 3, len(moving)))
        for row, site in enumerate(self._modules.tolist()):
            foot = data.site_xpos[site] - [0.0, 0.0, self._half_height]
            mujoco.mj_jac(model, data, jacobian, None, foot, int(model.site_bodyid[site]))
            shifting[row] = jacobian[:, moving]
        mujoco.mj_jacSubtreeCom(model, data, jacobian, self._root)
        center = data.subtree_com[self._root]
        lifting = jacobian[2, moving].copy()
        distance = data.contact.dist[found].copy()
        return _Linearized(qpos, distance, leaving, float(center[2]), lifting, shifting)

    def _find_step(
        self, pose: _Linearized, step: float, gap: float
    ) -> tuple[Float[np.ndarray, " nv"], float]:
        """Return the step that lowers the center of mass most, and what friction takes [m], as a height.

        Unknowns of the linear program are the step, the largest overlap, and how far each module slides along x and y.
        """
        from scipy.optimize import linprog

        is_near = pose.distance < gap + _REACH * step
        distance, leaving = pose.distance[is_near], pose.leaving[is_near]
        rising, sliding = pose.shifting[:, 2], pose.shifting[:, :2].reshape(-1, len(pose.lifting))
        rows = [
            (-leaving, -1.0, 0.0),
            (rising, 0.0, 0.0),
            (-rising, 0.0, 0.0),
            (sliding, 0.0, -1.0),
            (-sliding, 0.0, -1.0),
        ]
        friction = np.full(len(sliding), _FRICTION / len(rising))
        found = linprog(
            np.concatenate([pose.lifting, [_PENALTY], friction]),
            A_ub=np.concatenate([_join(each, overlap, slide, len(sliding)) for each, overlap, slide in rows]),
            b_ub=np.concatenate([distance - gap, np.full(2 * len(rising), step), np.zeros(2 * len(sliding))]),
            bounds=[*self._find_bounds(pose.qpos, step), *[(0.0, None)] * (1 + len(sliding))],
            method="highs-ds",
        )
        change = np.zeros(self._model.nv)
        if found.x is None:
            return change, 0.0
        change[self._moving] = found.x[: len(self._moving)]
        return change, float(friction @ found.x[-len(sliding) :])

    def _find_bounds(self, qpos: Float[np.ndarray, " nq"], step: float) -> list[tuple[float, float]]:
        """Return the smallest and largest change of each degree of freedom that moves."""
        turn, angle = _TURN_PER_STEP * step, qpos[self._qpos]
        low, high = np.maximum(-turn, -self._limit - angle), np.minimum(turn, self._limit - angle)
        return [
            (-step, step),
            (-step, step),
            (-step, step),
            (-turn, turn),
            (-turn, turn),
            *zip(low.tolist(), high.tolist(), strict=True),
        ]


def _join(
    rows: Float[np.ndarray, "R m"], overlap: float, slide: float, num_slides: int
) -> Float[np.ndarray, "R M"]:
    """Return rows of the linear program: coefficients of the step, of the overlap, and of a slide for each row."""
    slides = np.eye(len(rows), num_slides) * slide
    return np.hstack([rows, np.full((len(rows), 1), overlap), slides])


def compute_depth(model: mujoco.MjModel, data: mujoco.MjData, qpos: Float[np.ndarray, " nq"]) -> float:
    """Return how deep a pose reaches into the ground, or into itself [m]."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    return float(-data.contact.dist.min(initial=0.0))


_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def tumble(scene: Scene, qpos: Float[np.ndarray, " nq"], yaw: float, roll: float) -> Float[np.ndarray, " nq"]:
    """Return qpos of an organism that is turned about the axis of its head, its hinges straight.

    It is as low as it can be with all corners of its modules above the ground, as a body that fell over.
    """
    turned = qpos.copy()
    turned[7:] = 0.0
    upright, about, matrix = np.zeros(4), np.zeros(4), np.zeros(9)
    mujoco.mju_axisAngle2Quat(upright, np.array([0.0, 0.0, 1.0]), yaw)
    mujoco.mju_axisAngle2Quat(about, np.array([1.0, 0.0, 0.0]), roll)
    mujoco.mju_mulQuat(turned[3:7], upright, about)
    mujoco.mju_quat2Mat(matrix, turned[3:7])
    corners = _find_corners(scene.organism) @ matrix.reshape(3, 3).T
    x, y = (corners + turned[:3])[:, :2].T
    edge = scene.organism.scout.size[2]
    ground = scene.find_ground(x, y, np.full(len(x), turned[2] + edge))
    ground = np.where(np.isfinite(ground), ground, turned[2] - edge / 2)
    turned[2] = float(np.max(ground - corners[:, 2])) + LIFT
    return turned


def _find_corners(organism: Organism) -> Float[np.ndarray, "C 3"]:
    """Return the corners of all modules about the center of module 0, hinges straight [m]."""
    half = np.array(organism.scout.size) / 2
    places = np.array([(pose.x, pose.y, 0.0) for pose in organism.compute_poses()])
    return (places[:, None] + _CORNERS * half).reshape(-1, 3)
