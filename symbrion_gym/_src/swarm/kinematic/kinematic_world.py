"""Robots with simple motion: fast, exact in what they sense, without forces."""

import numpy as np
from jaxtyping import Float, Int

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
from symbrion_gym._src.swarm.kinematic.ground import GroundFit, fit_ground
from symbrion_gym._src.swarm.kinematic.motion import (
    FULL,
    GRIP,
    STAY,
    TURN,
    Poses,
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
from symbrion_gym._src.swarm.kinematic.skidding import compute_twists
from symbrion_gym._src.swarm.sight import Sight
from symbrion_gym._src.swarm.world import DECISION, FRONT, SwarmCommands, SwarmState
from symbrion_gym._src.traversability.footprint import STEP_LIMITS

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

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Place the robots on the ground, undocked, at x [m], y [m] and heading [rad]; the seed is of their slip."""
        poses, count = np.asarray(poses, dtype=np.float64), self.num_robots
        if poses.shape != (count, 3) or not np.isfinite(poses).all():
            raise OptionError(f"poses must be [{count}, 3] finite numbers (x, y, heading), got {poses.shape}")
        self._rng = np.random.default_rng(seed)
        self._roots = np.arange(count)
        position = np.column_stack([poses[:, :2], np.zeros(count)])
        rotation = make_rotations(np.tile([0.0, 0.0, 1.0], (count, 1)), poses[:, 2])
        fit = self._fit_ground(position, rotation)
        for _ in range(_LANDING_ROUNDS):
            self._check_ground(poses, fit)
            rotation, position[:, 2] = make_rotations(fit.normal, poses[:, 2]), fit.height
            fit = self._fit_ground(position, rotation)
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

    def _mate(self, layout: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
        """Return a layout that is nearer to that of the exact docked poses."""
        share = DECISION / max(self._mated_at - self.time, DECISION)
        off = self._nominal - layout
        off[:, 2] = np.arctan2(np.sin(off[:, 2]), np.cos(off[:, 2]))
        longest = np.zeros(self.num_robots)
        np.maximum.at(longest, self._roots, share * np.hypot(off[:, 0], off[:, 1]))
        shares = share * np.minimum(1.0, _MOST_PULL / np.maximum(longest, _MOST_PULL))[self._roots]
        return layout + shares[:, None] * off

    def _fit_ground(
        self, position: Float[np.ndarray, "N 3"], rotation: Float[np.ndarray, "N 3 3"]
    ) -> GroundFit:
        return fit_ground(self.arena, self.sight, position, rotation, self._roots)

    def _ask_ground(self, fit: GroundFit) -> Int[np.ndarray, " N"]:
        """Return what of its motion the ground allows each robot; what got no worse is allowed."""
        is_bad = ~np.isfinite(fit.height) | ~np.isfinite(fit.slope)
        for now, before, limit in zip(fit[2:], self._fit[2:], _LIMITS, strict=True):
            is_bad |= now > np.maximum(limit, before)
        level = np.where(is_bad, np.where(find_members(self.groups), STAY, TURN), FULL)
        return spread_level(level, self.groups)

    def _check_ground(self, poses: Float[np.ndarray, "N 3"], fit: GroundFit) -> None:
        """Refuse places on which a robot cannot stand."""
        for robot, (x, y, _) in enumerate(poses):
            slope, step, unknown, wall = (values[robot] for values in fit[2:])
            if not unknown <= MOST_UNKNOWN or not np.isfinite(fit.height[robot]):
                what = "off the surface"
            elif not slope <= STEEPEST:
                what = f"on a slope of {np.rad2deg(slope):.0f} degrees; it climbs {np.rad2deg(STEEPEST):.0f}"
            elif wall > 0.0:
                what = f"{wall:.3f} m within a wall"
            elif not step <= HIGHEST_STEP:
                what = f"at a step of {step:.3f} m; it climbs {HIGHEST_STEP:g}"
            else:
                continue
            name = self.arena.name
            raise ArenaError(f"robot {robot} at ({x:.2f}, {y:.2f}) of arena {name!r} stands {what}; move it")

    def _check_overlaps(self, poses: Poses) -> None:
        """Refuse robots that are within each other."""
        first, second = find_pairs(poses.position, 2 * SCOUT.arm_reach)
        depth = find_overlaps(poses.outlines[first], poses.outlines[second])
        if depth.max(initial=0.0) > GRIP:
            one, other = first[depth.argmax()], second[depth.argmax()]
            raise ArenaError(
                f"robots {one} and {other} overlap by {depth.max():.3f} m; place them farther apart"
            )
