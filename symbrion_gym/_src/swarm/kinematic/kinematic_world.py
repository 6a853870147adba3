"""Robots with simple motion: fast, exact in what they sense, without forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym._src.errors import ArenaError, OptionError
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.docks import (
    DockConfig,
    find_groups,
    find_matches,
    find_released,
    make_organism,
    sort_links,
)
from symbrion_gym._src.swarm.kinematic.motion import (
    FULL,
    STAY,
    TURN,
    KinematicConfig,
    Poses,
    avoid_overlaps,
    choose_roots,
    compute_spins,
    find_layout,
    find_overlaps,
    find_pairs,
    hold_arms,
    make_rotations,
    outline,
    place_members,
    select,
    spread_level,
    take,
)
from symbrion_gym._src.swarm.kinematic.skidding import (
    Ground,
    GroundFit,
    find_skids,
    find_track_points,
    interpolate,
)
from symbrion_gym._src.swarm.sight import Sight
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands, SwarmState

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.scout_constants import ScoutConfig


def compute_twists(
    tracks: Float[np.ndarray, "N 2"],
    groups: Int[np.ndarray, " N"],
    layout: Float[np.ndarray, "N 3"],
    hinge: Float[np.ndarray, " N"],
    pulls: Float[np.ndarray, "N 2"],
    scout: ScoutConfig,
) -> Float[np.ndarray, "N 3"]:
    """Return the motion of the root of each robot's group: ahead [m/s], left [m/s], turn [rad/s].

    Single robots turn as the balance of Coulomb friction says, and slide downhill as they do. A docked group is one
    rigid body: of all its motions in the plane, that in which its tracks slip least (least squares).

    References:
        Wong and Chiang (2001), Proc. IMechE D 215, for single robots; Mandow et al. (2007), IROS, for groups.
    """
    single = interpolate(find_skids(scout), np.cos(hinge), pulls, tracks[:, 1] - tracks[:, 0])
    single[:, 0] += (tracks[:, 0] + tracks[:, 1]) / 2
    size = np.bincount(groups, minlength=len(groups))
    if size.max(initial=0) <= 1:
        return single
    twists = _fit_twists(tracks, groups, layout, find_track_points(scout))
    return np.where(size[groups, None] > 1, twists, single)


def _fit_twists(
    tracks: Float[np.ndarray, "N 2"],
    groups: Int[np.ndarray, " N"],
    layout: Float[np.ndarray, "N 3"],
    points: Float[np.ndarray, "P 2"],
) -> Float[np.ndarray, "N 3"]:
    c, s = np.cos(layout[:, 2:]), np.sin(layout[:, 2:])
    x = layout[:, :1] + c * points[:, 0] - s * points[:, 1]
    y = layout[:, 1:2] + s * points[:, 0] + c * points[:, 1]
    speed = tracks[:, np.where(points[:, 1] > 0, 0, 1)]
    u, v = c * speed, s * speed

    def average(values: Float[np.ndarray, "N P"]) -> Float[np.ndarray, "N 1"]:
        total = np.bincount(groups, values.mean(axis=1), len(groups)) / np.maximum(
            np.bincount(groups, minlength=len(groups)), 1
        )
        return total[groups, None]

    center_x, center_y, mean_u, mean_v = (average(values) for values in (x, y, u, v))
    x, y = x - center_x, y - center_y
    turn = average(x * v - y * u) / average(x**2 + y**2)
    return np.column_stack([mean_u + turn * center_y, mean_v - turn * center_x, turn])


_LANDING_ROUNDS = 3  # Fits of the ground when robots are placed: the foot of a robot moves as it tilts
_LOWEST_ARM = -0.6  # Angle at which the free arm of a robot touches the ground [rad]
_MOST_PULL = 0.02
"""Docks that mate pull no robot farther than this in a decision [m], even where something was in the way before."""
_FRONT = SIDES.index("front")


class KinematicWorld:
    """N skid-steered Scouts on the height of an arena's surface (a `SwarmWorld`).

    Robots tilt with the ground below their tracks. They stop at what is steeper than one Scout climbs, at steps, pits
    and the end of the surface, and at each other; `blocked` says which ones. Nothing falls, is pushed or slides, and
    `state.load` is always 0. A docked group moves as one rigid body with straight hinges, on the plane below all of its
    tracks; latched pairs reach their exact pose within `DockConfig.mating_time`.

    Attributes:
        arena: where they are.
        scout: constants of the robots.
        docks: when docks latch.
        config: limits and errors of the motion.
        num_robots: N.
        time: since the reset [s].
        state: as it is now; a new object after every step.
        blocked: `[N]` whether a robot could not move as it was told in the last step.
        groups: `[N]` for each robot the smallest index in its group of docked robots.
        sight: rays in the arena, which `Senses` and `Signals` share.
    """

    def __init__(
        self,
        arena: Arena,
        num_robots: int,
        scout: ScoutConfig | None = None,
        docks: DockConfig | None = None,
        config: KinematicConfig | None = None,
    ) -> None:
        """Prepare the ground; `reset` places the robots.

        Args:
            arena: where they are.
            num_robots: how many, at least 1.
            scout: constants of the robots; None for the defaults.
            docks: when docks latch; None for the defaults.
            config: limits and errors of the motion; None for the defaults.

        Raises:
            OptionError: fewer than 1 robot.
        """
        if isinstance(num_robots, bool) or not isinstance(num_robots, int | np.integer) or num_robots < 1:
            raise OptionError(f"num_robots must be a whole number of at least 1, got {num_robots!r}")
        self.arena, self.num_robots = arena, int(num_robots)
        self.scout, self.docks = scout or ScoutConfig(friction=arena.friction), docks or DockConfig()
        self.config = config or KinematicConfig()
        self.sight = Sight(arena, self.scout)
        self._ground = Ground(arena, self.scout, self.config, self.sight)
        self._rng = np.random.default_rng(0)
        self._roots = np.arange(self.num_robots)
        self._mated_at = np.zeros(self.num_robots)

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Place the robots on the ground, undocked, at x [m], y [m] and heading [rad].

        Args:
            poses: one row a robot.
            seed: of the slip of the tracks.

        Raises:
            OptionError: the poses are not N rows of three finite numbers.
            ArenaError: a place off the surface, too steep, or within another robot.
        """
        poses = np.asarray(poses, dtype=np.float64)
        if poses.shape != (self.num_robots, 3) or not np.isfinite(poses).all():
            raise OptionError(
                f"poses must be [{self.num_robots}, 3] finite numbers (x, y, heading), got shape {poses.shape}"
            )
        self._rng = np.random.default_rng(seed)
        count = self.num_robots
        groups = self._roots = np.arange(count)
        position = np.column_stack([poses[:, :2], np.zeros(count)])
        rotation = make_rotations(np.tile([0.0, 0.0, 1.0], (count, 1)), poses[:, 2])
        fit = self._ground.fit(position, rotation, groups)
        for _ in range(_LANDING_ROUNDS):
            self._check_ground(poses, fit)
            rotation = make_rotations(fit.normal, poses[:, 2])
            position[:, 2] = self._compute_center_height(fit)
            fit = self._ground.fit(position, rotation, groups)
        hinge = np.zeros(count)
        self._check_overlaps(Poses(position, rotation, hinge))
        zero = np.zeros((count, 3))
        self.time = 0.0
        self._adopt(
            SwarmState(position, rotation, zero, zero, hinge, (), np.zeros((count, 4)), np.zeros((count, 2))),
            fit,
        )

    def set_state(self, state: SwarmState, time: float) -> None:
        """Go on from a state, also one of another level of physics; latched pairs mate again.

        Args:
            state: of the robots.
            time: since the reset [s].

        Raises:
            OptionError: the state is of another number of robots.
        """
        if len(state.position) != self.num_robots:
            raise OptionError(
                f"a state of {len(state.position)} robots does not fit a world of {self.num_robots}"
            )
        self.time = time
        groups = find_groups(state.links, self.num_robots)
        self._adopt(state, self._ground.fit(state.position, state.rotation, groups))
        self._follow_links()

    def step(self, commands: SwarmCommands) -> None:
        """Advance by one decision.

        Raises:
            OptionError: a command is not finite or has another shape.
        """
        tracks, hinge = self._check_commands(commands)
        self._latch(np.asarray(commands.latch, bool))
        old = Poses(self.state.position, self.state.rotation, self.state.hinge)
        is_wanted = (tracks != 0.0).any(axis=1)
        slip = 1.0 + self.config.slip * self._draw_slip()
        full, turned, fit = self._propose(old, tracks * slip, hinge)
        level = self._ask_ground(fit)
        level = avoid_overlaps(level, full, turned, old, self.groups, self.scout, self.config.grip)
        self.blocked = (level != FULL) & is_wanted
        self._fit = GroundFit(
            *(
                np.where(level.reshape(-1, *[1] * (a.ndim - 1)) == FULL, a, b)
                for a, b in zip(fit, self._fit, strict=True)
            )
        )
        self.time += DECISION
        new = select(level, full, turned, old)
        new = hold_arms(new, old.hinge, self.groups, self.scout, self.config.grip)
        self._finish(new, old, tracks)

    def _draw_slip(self) -> Float[np.ndarray, "N 2"]:
        return self._rng.standard_normal((self.num_robots, 2))

    def _check_commands(
        self, commands: SwarmCommands
    ) -> tuple[Float[np.ndarray, "N 2"], Float[np.ndarray, " N"]]:
        """Return tracks within their speed, and the hinges' angles after this step."""
        count = self.num_robots
        shapes = np.shape(commands.tracks), np.shape(commands.hinge), np.shape(commands.latch)
        if shapes != ((count, 2), (count,), (count, 4)):
            raise OptionError(f"commands of {count} robots are [N, 2], [N] and [N, 4], got {shapes}")
        if not (np.isfinite(commands.tracks).all() and np.isfinite(commands.hinge).all()):
            raise OptionError("commands must be finite; a track speed or a hinge angle is not")
        limit = self.scout.track_speed
        tracks = np.clip(np.asarray(commands.tracks, dtype=np.float64), -limit, limit)
        target = np.clip(commands.hinge, max(_LOWEST_ARM, -self.scout.hinge_range), self.scout.hinge_range)
        target = np.where(self._is_straight, 0.0, target)
        most = self.scout.hinge_speed * DECISION
        return tracks, self.state.hinge + np.clip(target - self.state.hinge, -most, most)

    def _latch(self, latch: Bool[np.ndarray, "N 4"]) -> None:
        """Open and close docks as they are told."""
        released = find_released(self.state.links, latch)
        kept = tuple(link for link in self.state.links if link not in released)
        state = self.state._replace(links=kept)
        formed = find_matches(state, latch, self.docks, self.scout)
        if released or formed:
            self.state = state._replace(links=sort_links([*kept, *formed]))
            self._follow_links(is_known=True)

    def _follow_links(self, is_known: bool = False) -> None:
        """Find groups, where their members belong, and when they will be there.

        Args:
            is_known: whether it is known who stood when its docks latched, which a state of another world does not
                tell; there the smaller number leads.
        """
        links = self.state.links
        self.groups = find_groups(links, self.num_robots)
        speed = np.linalg.norm(self.state.velocity, axis=1) * is_known
        self._roots = choose_roots(self.groups, self._roots, speed)
        self._is_straight = np.zeros(self.num_robots, bool)
        self._nominal = np.zeros((self.num_robots, 3))
        for link in links:
            for robot, side in link.ends:
                self._is_straight[robot] |= side == SIDES[_FRONT]
        for root in np.unique(self._roots[[link.first for link in links]]) if links else ():
            organism, order = make_organism(
                links, np.flatnonzero(self._roots == root).tolist(), self.scout, int(root)
            )
            self._nominal[list(order)] = [(pose.x, pose.y, pose.heading) for pose in organism.compute_poses()]
        self._mated_at = np.full(self.num_robots, self.time + self.docks.mating_time)

    def _propose(
        self, old: Poses, tracks: Float[np.ndarray, "N 2"], hinge: Float[np.ndarray, " N"]
    ) -> tuple[Poses, Poses, GroundFit]:
        """Return where robots would be after their motion and after its turn alone, and the ground of the first."""
        groups = self._roots
        layout = self._mate(find_layout(old, groups))
        pulls = -old.rotation[:, 2, :2] / old.rotation[:, 2, 2:]
        twist = compute_twists(tracks, groups, layout, old.hinge, pulls, self.scout)
        root_rotation, root_heading = old.rotation[groups], old.heading[groups]
        turn = twist[:, 2] * DECISION
        c, s = np.cos(0.5 * turn), np.sin(0.5 * turn)
        ahead, left = twist[:, 0] * DECISION, twist[:, 1] * DECISION
        way = (c * ahead - s * left)[:, None] * root_rotation[:, :, 0]
        way += (s * ahead + c * left)[:, None] * root_rotation[:, :, 1]
        position, heading = old.position[groups] + way, root_heading + turn
        guess = place_members(position, make_rotations(root_rotation[:, :, 2], heading), layout, hinge)
        fit = self._ground.fit(guess.position, guess.rotation, groups)
        normal = np.where(np.isfinite(fit.normal), fit.normal, root_rotation[:, :, 2])
        rotation = make_rotations(normal, heading)
        position[:, 2] = np.where(np.isfinite(fit.height), self._compute_center_height(fit), position[:, 2])
        full = place_members(position, rotation, layout, hinge)
        turned = Poses(old.position, make_rotations(old.rotation[:, :, 2], old.heading + turn), hinge)
        return full, turned, fit

    def _mate(self, layout: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
        """Return a layout that is nearer to that of the exact docked poses."""
        left = self._mated_at - self.time
        share = DECISION / np.maximum(left, DECISION)
        off = self._nominal - layout
        off[:, 2] = np.arctan2(np.sin(off[:, 2]), np.cos(off[:, 2]))
        way = share * np.hypot(off[:, 0], off[:, 1])
        longest = np.zeros(self.num_robots)
        np.maximum.at(longest, self._roots, way)
        share = share * np.minimum(1.0, _MOST_PULL / np.maximum(longest, _MOST_PULL))[self._roots]
        return layout + share[:, None] * off

    def _compute_center_height(self, fit: GroundFit) -> Float[np.ndarray, " N"]:
        """Return the height of the center of each robot's root above the foot of its normal [m]."""
        return fit.height + self.scout.size[2] / 2 * fit.normal[:, 2]

    def _ask_ground(self, fit: GroundFit) -> Int[np.ndarray, " N"]:
        """Return what of its motion the ground allows each robot; what got no worse is allowed."""
        limits = np.deg2rad(self.config.max_slope), self.config.max_step, self.config.max_unknown, 0.0
        is_bad = ~np.isfinite(fit.height) | ~np.isfinite(fit.slope)
        for now, before, limit in zip(fit[2:], self._fit[2:], limits, strict=True):
            is_bad |= now > np.maximum(limit, before)
        is_member = np.bincount(self.groups, minlength=self.num_robots)[self.groups] > 1
        level = np.where(is_bad, np.where(is_member, STAY, TURN), FULL)
        return spread_level(level, self.groups)

    def _finish(self, new: Poses, old: Poses, tracks: Float[np.ndarray, "N 2"]) -> None:
        """Keep the new poses with the rates that led to them."""
        spin = compute_spins(old.rotation, new.rotation, DECISION)
        self.state = self.state._replace(
            position=new.position,
            rotation=new.rotation,
            velocity=(new.position - old.position) / DECISION,
            spin=spin,
            hinge=new.hinge,
            odometry=self.state.odometry + tracks * DECISION,
        )

    def _adopt(self, state: SwarmState, fit: GroundFit) -> None:
        self.state, self._fit = state, fit
        self.blocked = np.zeros(self.num_robots, bool)
        self._follow_links()

    def _check_ground(self, poses: Float[np.ndarray, "N 3"], fit: GroundFit) -> None:
        """Refuse places on which a robot cannot stand."""
        slope = np.rad2deg(fit.slope)
        for robot, (x, y, _) in enumerate(poses):
            where = f"robot {robot} at ({x:.2f}, {y:.2f}) of arena {self.arena.name!r}"
            if not fit.unknown[robot] <= self.config.max_unknown or not np.isfinite(fit.height[robot]):
                raise ArenaError(f"{where} stands off the surface; place it on known ground")
            if not slope[robot] <= self.config.max_slope:
                raise ArenaError(
                    f"{where} stands on a slope of {slope[robot]:.0f} degrees, more than the "
                    f"{self.config.max_slope:g} that it climbs; place it elsewhere"
                )
            if fit.wall[robot] > 0.0:
                raise ArenaError(f"{where} stands {fit.wall[robot]:.3f} m within a wall; place it elsewhere")
            if not fit.step[robot] <= self.config.max_step:
                raise ArenaError(
                    f"{where} stands at a step of {fit.step[robot]:.3f} m, more than the "
                    f"{self.config.max_step:g} that it climbs; place it elsewhere"
                )

    def _check_overlaps(self, poses: Poses) -> None:
        """Refuse robots that are within each other."""
        first, second = find_pairs(poses.position, 2 * self.scout.arm_reach)
        outlines = outline(poses, self.scout)
        depth = find_overlaps(take(outlines, first), take(outlines, second), self.scout)
        if depth.max(initial=0.0) > self.config.grip:
            worst = depth.argmax()
            raise ArenaError(
                f"robots {first[worst]} and {second[worst]} overlap by {depth[worst]:.3f} m; place them farther apart"
            )
