"""An organism put on the ground: bent along it if it is a snake, else settled as if let down with all servos loose."""

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.geometry.pose import PlanarPose, make_quaternion
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import Organism, snake

Samples = Float[np.ndarray, " S"]  # Of places along a line

LIFT = 0.002
"""Gap between the tracks and the ground at the start [m]: without one, contacts would begin with a push."""
_SAMPLES = 0.005  # Spacing of the heights along the start line [m], small against a module
_LINE_MARGIN = 0.2  # The line of heights reaches this much farther than the organism at both ends [m]
_FOOTPRINT = 0.06 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [0.0, 0.0]])
"""Points of a module over which the highest ground is taken where organisms are no snakes [m]: a little beyond its
sides, which are 0.0525 m from its center."""
_NUM_ITERATIONS = 8  # Of the fixed-point iteration that puts a module's end on the ground
_SMALLEST_STEP = 0.2  # A module stands no steeper than this share of its length along the ground
_STRETCH = 20  # The ground on a storey is followed over as many samples at a time: a module's length
_STOREY_RISE = 0.10
"""Ground that rises by more than this over such a stretch is what hangs above, not ground [m]."""


class GroundPlacement:
    """Lays an organism on the ground of an arena."""

    def __init__(self, arena: Arena, organism: Organism, level: float | None) -> None:
        self._arena, self._organism = arena, organism
        self._level = level  # height of the storey of the start [m]; None where there is only one
        self._poses = organism.compute_poses()
        # The hinges of a snake follow the ground; other bodies are laid flat, and `Settler` bends them.
        self.is_snake = organism == snake(organism.num_modules, organism.scout)

    def lay(self, head: PlanarPose) -> tuple[Float[np.ndarray, " 7"], Float[np.ndarray, " h"]]:
        """Return place (x, y, z) and orientation (w, x, y, z) of module 0, and the angles of the working hinges."""
        if self.is_snake:
            height, pitch, hinges = self._follow_line(head)
        else:
            height, pitch, hinges = self._find_top(head), 0.0, np.zeros(len(self._organism.hinges))
        return np.array([head.x, head.y, height, *make_quaternion(head.heading, -pitch)]), hinges

    def _follow_line(self, head: PlanarPose) -> tuple[float, float, Float[np.ndarray, " h"]]:
        """Return head height, head pitch and hinge angles of a snake."""
        organism = self._organism
        back = np.arange(
            -_LINE_MARGIN, (organism.num_modules + 1) * organism.scout.pitch + _LINE_MARGIN, _SAMPLES
        )
        x, y = head.x - np.cos(head.heading) * back, head.y - np.sin(head.heading) * back
        heights = _roll_over(self._compute_heights(x, y), organism.scout.size[2] / 2) + LIFT
        return _follow_ground(back, heights, organism)

    def _find_top(self, head: PlanarPose) -> float:
        """Return the height of module 0 with which a flat body clears the highest ground below it.

        On one of several storeys, the ground below a module is that near the height of the ground below its parent.
        """
        organism = self._organism
        world = [head.compose(pose) for pose in self._poses]
        spots = np.array([(pose.x, pose.y) for pose in world])[:, None] + _FOOTPRINT
        heights, levels = np.full(spots.shape[:2], np.nan), {-1: self._level}
        for module in organism.order:
            level = levels[organism.parents[module]]
            x, y = spots[module].T
            heights[module] = self._find_ground(x, y, level)
            known = heights[module][np.isfinite(heights[module])]
            levels[module] = known.max() if len(known) and level is not None else level
        if not np.isfinite(heights).any():
            raise self._make_error(head.x, head.y)
        return float(np.nanmax(heights)) + organism.scout.size[2] / 2 + LIFT

    def _find_ground(self, x: Samples, y: Samples, level: float | None) -> Samples:
        """Return heights of the ground below what hangs above a level; nan where there is none."""
        if level is None:
            return np.asarray(self._arena.height(x, y), dtype=np.float64)
        return self._arena.elevation.height_below(x, y, level + _STOREY_RISE)

    def _make_error(self, x: float, y: float) -> ArenaError:
        return ArenaError(f"the start ({x:.2f}, {y:.2f}) lies off the surface of arena {self._arena.name!r}")

    def _compute_heights(self, x: Samples, y: Samples) -> Samples:
        """Return ground heights; beyond the rim, the nearest known one along the line."""
        heights, level = np.full(len(x), np.nan), self._level
        for first in range(0, len(x), _STRETCH):
            some = slice(first, first + _STRETCH)
            heights[some] = self._find_ground(x[some], y[some], level)
            known = heights[some][np.isfinite(heights[some])]
            level = known[-1] if len(known) and level is not None else level
        known = np.flatnonzero(np.isfinite(heights))
        if not len(known):
            raise self._make_error(x[0], y[0])
        return np.interp(np.arange(len(heights)), known, heights[known])


def _roll_over(heights: Samples, radius: float) -> Samples:
    """Return how high the center of a disc rolls over ground heights sampled every `_SAMPLES`."""
    from scipy.ndimage import grey_dilation

    reach = int(radius / _SAMPLES)
    shift = np.arange(-reach, reach + 1)
    rise = np.sqrt(np.maximum(radius**2 - (shift * _SAMPLES) ** 2, 0.0))
    return grey_dilation(heights, structure=rise, mode="nearest")


def _follow_ground(
    back: Samples, heights: Samples, organism: Organism
) -> tuple[float, float, Float[np.ndarray, " h"]]:
    """Lay a snake on a height line, head at 0; return head height, head pitch and hinge angles."""
    pitch, count = organism.scout.pitch, organism.num_modules
    s, z = np.zeros(count + 1), np.zeros(count + 1)
    z[0] = np.interp(0.0, back, heights)
    for i in range(1, count + 1):
        step = pitch
        for _ in range(_NUM_ITERATIONS):
            z[i] = np.interp(s[i - 1] + step, back, heights)
            step = np.sqrt(max(pitch**2 - (z[i] - z[i - 1]) ** 2, (_SMALLEST_STEP * pitch) ** 2))
        s[i] = s[i - 1] + step
    nose_up = np.arctan2(z[:-1] - z[1:], s[1:] - s[:-1])
    limit = organism.scout.hinge_range
    return float(z[0]), float(nose_up[0]), np.clip(nose_up[:-1] - nose_up[1:], -limit, limit)


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

    References:
        Fletcher & Sainz de la Maza (1989), Mathematical Programming 43: sequential linear programming with a trust
        region. Mielke (2005), Evolution in rate-independent systems: friction as a cost of each step.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        modules: Int[np.ndarray, " n"],  # ids of the sites that mark the modules
        joints: Int[np.ndarray, " h"],  # addresses in qvel
        half_height: float,  # of a module's center above its underside [m]
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
        _find_contacts(model, data, qpos)
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
        near, n, s = len(leaving), len(rising), len(sliding)
        friction = np.full(s, _FRICTION / n)
        still = [np.zeros((n, 1)), np.zeros((n, s))]
        slips = [np.zeros((s, 1)), -np.eye(s)]
        limits = [
            [-leaving, -np.ones((near, 1)), np.zeros((near, s))],
            *([rising, *still], [-rising, *still], [sliding, *slips], [-sliding, *slips]),
        ]
        found = linprog(
            np.concatenate([pose.lifting, [_PENALTY], friction]),
            A_ub=np.block(limits),
            b_ub=np.concatenate([distance - gap, np.full(2 * n, step), np.zeros(2 * s)]),
            bounds=[*self._find_bounds(pose.qpos, step), *[(0.0, None)] * (1 + s)],
            method="highs-ds",
        )
        change = np.zeros(self._model.nv)
        if found.x is None:
            return change, 0.0
        change[self._moving] = found.x[: len(self._moving)]
        return change, float(friction @ found.x[-s:])

    def _find_bounds(self, qpos: Float[np.ndarray, " nq"], step: float) -> list[tuple[float, float]]:
        """Return the smallest and largest change of each degree of freedom that moves."""
        turn, angle = _TURN_PER_STEP * step, qpos[self._qpos]
        low, high = np.maximum(-turn, -self._limit - angle), np.minimum(turn, self._limit - angle)
        free = [(-step, step)] * 3 + [(-turn, turn)] * 2
        return [*free, *zip(low.tolist(), high.tolist(), strict=True)]


def compute_depth(model: mujoco.MjModel, data: mujoco.MjData, qpos: Float[np.ndarray, " nq"]) -> float:
    """Return how deep a pose reaches into the ground, or into itself [m]."""
    _find_contacts(model, data, qpos)
    return float(-data.contact.dist.min(initial=0.0))


def _find_contacts(model: mujoco.MjModel, data: mujoco.MjData, qpos: Float[np.ndarray, " nq"]) -> None:
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
