"""Robots with simple motion: fast, exact in what they sense, without forces.

They stand on the ground of an arena: on planes below their tracks, between slopes, steps and walls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError, OptionError
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.docks import (
    MATING_TIME,
    SCOUT,
    change_links,
    find_groups,
    make_organism,
    sort_links,
)
from symbrion_gym._src.swarm.kinematic.motion import (
    FULL,
    GRIP,
    STAY,
    TURN,
    Numbers,
    Poses,
    Vectors,
    avoid_overlaps,
    choose_roots,
    find_layout,
    find_members,
    find_overlaps,
    find_pairs,
    hold_arms,
    make_rotations,
    place_members,
    select,
    spread_level,
)
from symbrion_gym._src.swarm.kinematic.skidding import TRACK_POINTS, compute_twists
from symbrion_gym._src.swarm.senses import Sight
from symbrion_gym._src.swarm.world import DECISION, FRONT, SwarmCommands, SwarmState
from symbrion_gym._src.traversability.footprint import STEP_LIMITS

_NUM_RIM = 16  # Places on the rim of a chassis whose height is read: 2 cm apart
_NUM_SPOKES = 8  # Rays in the plane of the tracks from the center of a chassis to its rim
_LEAST_SPREAD = 1e-10  # Determinant below which the places of a plane lie on a line [m^4]
_RADIUS, _HALF_HEIGHT = SCOUT.size[0] / 2, SCOUT.size[2] / 2


def _make_circle(count: int) -> Float[np.ndarray, "C 2"]:
    angle = np.arange(count) * 2 * np.pi / count
    return np.column_stack([np.cos(angle), np.sin(angle)])


_RIM = _RADIUS * _make_circle(_NUM_RIM)
_SPOKES = np.column_stack([_make_circle(_NUM_SPOKES), np.zeros(_NUM_SPOKES)])


class GroundFit(NamedTuple):
    """How robots stand; the last four are what may be too much."""

    normal: Vectors  # of the plane below the group of each robot
    height: Float[np.ndarray, " N"]  # of the center of its group's root, where it stands on that plane [m]
    slope: Float[np.ndarray, " N"]  # of the plane below the tracks of each robot alone [rad]
    step: Float[np.ndarray, " N"]  # largest height of the rim of the chassis above or below that plane [m]
    unknown: Float[np.ndarray, " N"]  # share of the places whose height is unknown
    wall: Float[np.ndarray, " N"]  # how far walls reach into the disc of the chassis, at half its height [m]


def _find_fault(fit: GroundFit, robot: int) -> str:
    """Return in words why a robot cannot stand where it is, or nothing."""
    slope, step, unknown, wall = (values[robot] for values in fit[2:])
    if not unknown <= MOST_UNKNOWN or not np.isfinite(fit.height[robot]):
        return "off the surface"
    if not slope <= STEEPEST:
        return f"on a slope of {np.rad2deg(slope):.0f} degrees; it climbs {np.rad2deg(STEEPEST):.0f}"
    if wall > 0.0:
        return f"{wall:.3f} m within a wall"
    return "" if step <= HIGHEST_STEP else f"at a step of {step:.3f} m; it climbs {HIGHEST_STEP:g}"


def fit_ground(
    arena: Arena, sight: Sight, position: Vectors, rotation: Float[np.ndarray, "N 3 3"], groups: Numbers
) -> GroundFit:
    """Return how robots stand about where they are.

    A robot stands on the plane through the places below its tracks (least squares); a docked group on one through
    those of all its members. Steps are found at the rim of the chassis, a circle that does not turn with the robot, so
    that turning on the spot never gets it stuck; walls, however thin, by rays from its center to that rim.
    """
    foot = position[:, :2] - _HALF_HEIGHT * rotation[:, :2, 2]
    tracks = foot[:, None] + TRACK_POINTS @ rotation[:, :2, :2].transpose(0, 2, 1)
    places = np.concatenate([tracks, foot[:, None] + _RIM], axis=1)
    heights = arena.elevation.find_top(places[..., 0], places[..., 1], None)[0]
    below, rim = heights[:, : len(TRACK_POINTS)], heights[:, len(TRACK_POINTS) :]
    plane = own = _fit_planes(tracks - foot[:, None], below, np.arange(len(foot)))
    if (groups != np.arange(len(groups))).any():
        plane = _fit_planes(tracks - foot[groups][:, None], below, groups)
    above = rim - (own[:, 2:] + own[:, :1] * _RIM[:, 0] + own[:, 1:2] * _RIM[:, 1])
    step = np.max(np.where(np.isfinite(above), np.abs(above), 0.0), axis=1)
    normal = np.column_stack([-plane[:, :2], np.ones(len(plane))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    center = np.column_stack([foot, own[:, 2]]) + _HALF_HEIGHT * normal
    return GroundFit(
        normal,
        plane[:, 2] + _HALF_HEIGHT * normal[:, 2],
        np.arctan(np.hypot(own[:, 0], own[:, 1])),
        step,
        np.isnan(heights).mean(axis=1),
        _find_walls(sight, center, normal),
    )


def _find_walls(sight: Sight, center: Vectors, normal: Vectors) -> Float[np.ndarray, " N"]:
    """Return how far the surface reaches into the disc about each center, across the normal [m]."""
    center, flat = (np.where(np.isfinite(values), values, 0.0) for values in (center, normal))
    flat[flat[:, 2] == 0.0] = [0.0, 0.0, 1.0]
    spokes = make_rotations(flat, np.zeros(len(flat))) @ _SPOKES.T
    ways = spokes.transpose(0, 2, 1).reshape(-1, 3)
    distance = sight.cast(np.repeat(center, _NUM_SPOKES, axis=0), ways, _RADIUS)
    return np.maximum(_RADIUS - distance.reshape(-1, _NUM_SPOKES).min(axis=1), 0.0)


def _fit_planes(
    places: Float[np.ndarray, "N P 2"], heights: Float[np.ndarray, "N P"], groups: Numbers
) -> Vectors:
    """Return rise along x, rise along y and height at 0 of the least-squares plane of each robot's group; nan: none."""
    known = np.isfinite(heights)
    x, y, z = (np.where(known, values, 0.0) for values in (places[..., 0], places[..., 1], heights))
    count = len(groups)

    def add_up(values: Float[np.ndarray, "N P"]) -> Float[np.ndarray, " N"]:
        return np.bincount(groups, values.sum(axis=1), count)

    num = np.maximum(add_up(known.astype(np.float64)), 1.0)
    mean_x, mean_y, mean_z = (add_up(values) / num for values in (x, y, z))
    s_xx, s_yy, s_xy = (add_up(p) - num * q for p, q in (
        (x * x, mean_x**2), (y * y, mean_y**2), (x * y, mean_x * mean_y)))  # fmt: skip
    s_xz, s_yz = add_up(x * z) - num * mean_x * mean_z, add_up(y * z) - num * mean_y * mean_z
    spread = s_xx * s_yy - s_xy**2
    with np.errstate(divide="ignore", invalid="ignore"):
        along_x = (s_xz * s_yy - s_yz * s_xy) / spread
        along_y = (s_yz * s_xx - s_xz * s_xy) / spread
    plane = np.column_stack([along_x, along_y, mean_z - along_x * mean_x - along_y * mean_y])
    return np.where(spread[:, None] > _LEAST_SPREAD, plane, np.nan)[groups]


STEEPEST = np.deg2rad(20.0)
"""Steepest ground under the tracks [rad]. One Scout climbs 20 degrees in MuJoCo and tips over at 25 (`SLOPE_LIMIT`)."""
HIGHEST_STEP = STEP_LIMITS[0][1]
"""Highest step up or down at the rim of the chassis [m]. One Scout climbs 10 mm in MuJoCo (`STEP_LIMITS`); what is
higher, or a pit, stops it."""
MOST_UNKNOWN = 0.25
"""Largest share of the ground below a robot that may be unknown: scans have small holes. More is the end of it."""
SLIP = 0.03
"""Standard deviation of the speed of each track, as a share of it, in every decision (estimate). Odometry does not
notice it."""
_LIMITS = (STEEPEST, HIGHEST_STEP, MOST_UNKNOWN, 0.0)  # Of slope, step, unknown and wall of a `GroundFit`
_LANDING_ROUNDS = 3  # Fits of the ground when robots are placed: the foot of a robot moves as it tilts
_LOWEST_ARM = -0.6  # Angle at which the free arm of a robot touches the ground [rad]
_MOST_PULL = 0.02
"""Docks that mate pull no robot farther than this in a decision [m], even where something was in the way before."""


class KinematicWorld:
    """N skid-steered Scouts on the height of an arena's surface (a `SwarmWorld`).

    Robots tilt with the ground below their tracks. They stop at what is steeper than one Scout climbs, at steps, pits
    and the end of the surface, and at each other; `blocked` says which ones. Nothing falls, is pushed or slides. A
    docked group moves as one rigid body with straight hinges, on the plane below all of its tracks; latched pairs reach
    their exact pose within `MATING_TIME`. `scout` says what robots sense and their friction, `slip` how uneven they
    drive.
    """

    def __init__(
        self, arena: Arena, num_robots: int, scout: ScoutConfig | None = None, slip: float = SLIP
    ) -> None:
        self.arena, self.num_robots, self._slip = arena, num_robots, slip
        self.scout = scout or ScoutConfig(friction=arena.friction)
        self.sight = Sight(arena, self.scout)
        self._rng = np.random.default_rng(0)
        self._roots = np.arange(num_robots)  # Whose pose leads the group of each robot

    def reset(self, poses: Vectors, seed: int = 0) -> None:
        """Place the robots on the ground, undocked, at x [m], y [m] and heading [rad]; the seed is of their slip."""
        poses, count = np.asarray(poses, dtype=np.float64), self.num_robots
        if poses.shape != (count, 3) or not np.isfinite(poses).all():
            raise OptionError(f"poses must be [{count}, 3] finite numbers (x, y, heading), got {poses.shape}")
        self._rng = np.random.default_rng(seed)
        self._roots = np.arange(count)
        position, rotation, faults = self._land(poses)
        for robot, ((x, y, _), what) in enumerate(zip(poses, faults, strict=True)):
            if what:
                where = f"({x:.2f}, {y:.2f}) of arena {self.arena.name!r}"
                raise ArenaError(f"robot {robot} at {where} stands {what}; give it another pose")
        hinge, zero = np.zeros(count), np.zeros((count, 3))
        self._check_overlaps(Poses(position, rotation, hinge))
        self.set_state(SwarmState(position, rotation, zero, hinge, (), np.zeros((count, 2))), 0.0)

    def set_state(self, state: SwarmState, time: float) -> None:
        """Go on from a state, also one of another level of physics; latched pairs mate again.

        Who stood when its docks latched is not known: of equal parts, the one with the smaller number leads.
        """
        self.state, self.time = state, time
        self.blocked = np.zeros(self.num_robots, bool)  # Who could not move as told in the last step
        self._follow_links(np.zeros(self.num_robots))
        self._fit = self._fit_ground(state.position, state.rotation)

    def step(self, commands: SwarmCommands) -> None:
        """Advance by one decision."""
        commands.check(self.num_robots)
        hinge = self._turn_hinges(commands.hinge)
        gone, new_links = change_links(self.state, commands.latch)
        if gone or new_links:
            kept = [link for link in self.state.links if link not in gone]
            self.state = self.state._replace(links=sort_links([*kept, *new_links]))
            self._follow_links(np.linalg.norm(self.state.velocity, axis=1))
        tracks = np.clip(commands.tracks, -self.scout.track_speed, self.scout.track_speed)
        old = Poses(self.state.position, self.state.rotation, self.state.hinge)
        slip = 1.0 + self._slip * self._rng.standard_normal((self.num_robots, 2))
        full, turned, fit = self._propose(old, tracks * slip, hinge)
        level = avoid_overlaps(self._ask_ground(fit), full, turned, old, self.groups)
        is_full = level == FULL
        self.blocked = ~is_full & (tracks != 0.0).any(axis=1)
        self._fit = GroundFit(
            *(
                np.where(is_full if a.ndim == 1 else is_full[:, None], a, b)
                for a, b in zip(fit, self._fit, strict=True)
            )
        )
        new = hold_arms(select(level, full, turned, old), old.hinge, self.groups)
        self.time += DECISION
        self.state = SwarmState(
            new.position,
            new.rotation,
            (new.position - old.position) / DECISION,
            new.hinge,
            self.state.links,
            self.state.odometry + tracks * DECISION,
        )

    def _turn_hinges(self, target: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """Return the hinges' angles after this step."""
        target = np.clip(target, max(_LOWEST_ARM, -self.scout.hinge_range), self.scout.hinge_range)
        target = np.where(self.state.docked[:, FRONT], 0.0, target)
        most = self.scout.hinge_speed * DECISION
        return self.state.hinge + np.clip(target - self.state.hinge, -most, most)

    def _follow_links(self, speed: Float[np.ndarray, " N"]) -> None:
        """Find groups, where their members belong, and when they will be there."""
        links = self.state.links
        self.groups = find_groups(links, self.num_robots)
        self._roots = choose_roots(self.groups, self._roots, speed)
        self._nominal = np.zeros((self.num_robots, 3))
        for root in np.unique(self._roots[[link.first for link in links]]) if links else ():
            members = np.flatnonzero(self._roots == root).tolist()
            organism, order = make_organism(links, members, self.scout, int(root))
            self._nominal[list(order)] = [(pose.x, pose.y, pose.heading) for pose in organism.compute_poses()]
        self._mated_at = self.time + MATING_TIME

    def _propose(
        self, old: Poses, tracks: Float[np.ndarray, "N 2"], hinge: Float[np.ndarray, " N"]
    ) -> tuple[Poses, Poses, GroundFit]:
        """Return where robots would be after their motion and after its turn alone, and the ground of the first."""
        groups = self._roots
        layout = self._mate(find_layout(old, groups))
        pulls = -old.rotation[:, 2, :2] / old.rotation[:, 2, 2:]
        twist = compute_twists(tracks, groups, layout, old.hinge, pulls, self.scout.friction)
        root_rotation, turn = old.rotation[groups], twist[:, 2] * DECISION
        c, s = np.cos(0.5 * turn), np.sin(0.5 * turn)
        ahead, left = twist[:, 0] * DECISION, twist[:, 1] * DECISION
        way = (c * ahead - s * left)[:, None] * root_rotation[:, :, 0]
        way += (s * ahead + c * left)[:, None] * root_rotation[:, :, 1]
        position, heading = old.position[groups] + way, old.heading[groups] + turn
        guess = place_members(position, make_rotations(root_rotation[:, :, 2], heading), layout, hinge)
        fit = self._fit_ground(guess.position, guess.rotation)
        normal = np.where(np.isfinite(fit.normal), fit.normal, root_rotation[:, :, 2])
        position[:, 2] = np.where(np.isfinite(fit.height), fit.height, position[:, 2])
        full = place_members(position, make_rotations(normal, heading), layout, hinge)
        turned = Poses(old.position, make_rotations(old.rotation[:, :, 2], old.heading + turn), hinge)
        return full, turned, fit

    def _mate(self, layout: Vectors) -> Vectors:
        """Return a layout that is nearer to that of the exact docked poses."""
        share = DECISION / max(self._mated_at - self.time, DECISION)
        off = self._nominal - layout
        off[:, 2] = np.arctan2(np.sin(off[:, 2]), np.cos(off[:, 2]))
        longest = np.zeros(self.num_robots)
        np.maximum.at(longest, self._roots, share * np.hypot(off[:, 0], off[:, 1]))
        shares = share * np.minimum(1.0, _MOST_PULL / np.maximum(longest, _MOST_PULL))[self._roots]
        return layout + shares[:, None] * off

    def _fit_ground(self, position: Vectors, rotation: Float[np.ndarray, "N 3 3"]) -> GroundFit:
        return fit_ground(self.arena, self.sight, position, rotation, self._roots)

    def _ask_ground(self, fit: GroundFit) -> Numbers:
        """Return what of its motion the ground allows each robot; what got no worse is allowed."""
        is_bad = ~np.isfinite(fit.height) | ~np.isfinite(fit.slope)
        for now, before, limit in zip(fit[2:], self._fit[2:], _LIMITS, strict=True):
            is_bad |= now > np.maximum(limit, before)
        level = np.where(is_bad, np.where(find_members(self.groups), STAY, TURN), FULL)
        return spread_level(level, self.groups)

    def find_standing(self, poses: Vectors) -> Bool[np.ndarray, " N"]:
        """Return at which of any number of poses (x, y, heading) a robot can stand."""
        return np.array([not what for what in self._land(poses)[2]], dtype=bool)

    def _land(self, poses: Vectors) -> tuple[Vectors, Float[np.ndarray, "N 3 3"], list[str]]:
        """Return how undocked robots stand at poses, and in words why one cannot; no words where it can."""
        count = len(poses)
        position = np.column_stack([poses[:, :2], np.zeros(count)])
        rotation = make_rotations(np.tile([0.0, 0.0, 1.0], (count, 1)), poses[:, 2])
        faults = [""] * count
        for _ in range(_LANDING_ROUNDS):
            fit = fit_ground(self.arena, self.sight, position, rotation, np.arange(count))
            faults = [what or _find_fault(fit, robot) for robot, what in enumerate(faults)]
            rotation, position[:, 2] = make_rotations(fit.normal, poses[:, 2]), fit.height
        return position, rotation, faults

    def _check_overlaps(self, poses: Poses) -> None:
        """Refuse robots that are within each other."""
        first, second = find_pairs(poses.position, 2 * SCOUT.arm_reach)
        depth = find_overlaps(poses.outlines[first], poses.outlines[second])
        if depth.max(initial=0.0) > GRIP:
            one, other = first[depth.argmax()], second[depth.argmax()]
            raise ArenaError(
                f"robots {one} and {other} overlap by {depth.max():.3f} m; place them farther apart"
            )
