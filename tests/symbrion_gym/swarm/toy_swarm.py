"""A swarm of discs on a course of known profile, with exact senses: what the behaviors are tested in."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.behavior.percepts import Heard, Percepts, Wired, Words
from symbrion_gym._src.swarm.behavior.steering import HALF_GAUGE, SIDE_ANGLES, SLIP
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands, SwarmState

REACH = np.array([ScoutConfig().arm_reach, 0.0525, 0.0525, 0.0525])
CONE, RANGE = np.pi / 3, 1.5


def wrap(angle):
    """Return angles within -pi to pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


class ToySwarm:
    """N discs; docked ones stand still."""

    def __init__(self, poses: np.ndarray, course: Course | None = None, noise: float = 0.0, seed: int = 0):
        self.course, self.scout, self.noise = course or Course(), ScoutConfig(), noise
        self.pose, self.num_robots, self.time = np.array(poses, float), len(poses), 0.0
        self.odometry, self.links = np.zeros((len(poses), 2)), ()
        self.arena = SimpleNamespace(name="toy")
        self.rng = np.random.default_rng(seed)
        self.words, self.wire = Words.make_silent(len(poses)), None
        self.blocked = np.zeros(len(poses), bool)

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        line = self.course.profile()
        z = np.interp(x, *line.T)
        z = np.where(np.abs(x) < self.course.pit / 2, 0.0, z)
        out = (np.abs(y) > self.course.width / 2) | (np.abs(x) > self.course.length / 2)
        return np.where(out, -np.inf, z)

    def _docks(self) -> tuple[np.ndarray, np.ndarray]:
        angle = self.pose[:, 2:] + SIDE_ANGLES
        place = self.pose[:, None, :2] + REACH[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
        return place, angle

    @property
    def docked(self) -> np.ndarray:
        docked = np.zeros((self.num_robots, 4), bool)
        for link in self.links:
            for robot, side in link.ends:
                docked[robot, SIDES.index(side)] = True
        return docked

    def step(self, commands: SwarmCommands) -> None:
        self.links = tuple(
            link for link in self.links if all(commands.latch[r, SIDES.index(s)] for r, s in link.ends)
        )
        free, tracks = ~self.docked.any(-1), np.clip(commands.tracks, -0.1, 0.1)
        speed, rate = tracks.mean(-1), (tracks[:, 1] - tracks[:, 0]) / (2 * HALF_GAUGE * SLIP)
        self.odometry = self.odometry + tracks * DECISION
        new = self.pose + DECISION * np.stack(
            [speed * np.cos(self.pose[:, 2]), speed * np.sin(self.pose[:, 2]), rate], -1
        )
        for robot in np.flatnonzero(free):
            x, y = new[robot, :2]
            others = np.delete(self.pose[:, :2], robot, 0)
            gaps, old = np.hypot(*(others - [x, y]).T), np.hypot(*(others - self.pose[robot, :2]).T)
            bad = (gaps < 0.118) & (gaps < old)
            falls = self.height(x, y) < self.height(*self.pose[robot, :2]) - 0.1
            self.blocked[robot] = bad.any() or falls
            if not self.blocked[robot]:
                self.pose[robot, :2] = x, y
            self.pose[robot, 2] = new[robot, 2]
        self._latch(commands.latch)
        self.time += DECISION

    def _latch(self, latch: np.ndarray) -> None:
        place, angle = self._docks()
        for i in range(self.num_robots):
            for j in range(self.num_robots):
                for b in range(4):
                    if i == j or not (latch[i, 0] and latch[j, b]) or self.docked[i, 0] or self.docked[j, b]:
                        continue
                    apart = np.hypot(*(place[i, 0] - place[j, b]))
                    turned = abs(wrap(angle[i, 0] - angle[j, b] + np.pi))
                    if apart < 0.012 and turned < np.radians(12):
                        self.links = (*self.links, Docking(i, "front", j, SIDES[b]))
                        self.pose[i, 2] = wrap(angle[j, b] + np.pi)
                        ahead = np.array([np.cos(self.pose[i, 2]), np.sin(self.pose[i, 2])])
                        self.pose[i, :2] = place[j, b] - REACH[0] * ahead

    @property
    def tilt(self) -> tuple[np.ndarray, np.ndarray]:
        x, y, heading = self.pose.T
        slope = (self.height(x + 0.02, y) - self.height(x - 0.02, y)) / 0.04
        slope = np.where(np.abs(slope) < 1.0, slope, 0.0)
        return np.arctan(slope * np.cos(heading)), np.arctan(-slope * np.sin(heading))

    @property
    def state(self) -> SwarmState:
        x, y, heading = self.pose.T
        n, pitch = self.num_robots, self.tilt[0]
        rotation = np.zeros((n, 3, 3))
        rotation[:, 0, 0], rotation[:, 1, 0], rotation[:, 2, 0] = (
            np.cos(heading),
            np.sin(heading),
            np.sin(pitch),
        )
        rotation[:, 0, 1], rotation[:, 1, 1], rotation[:, 2, 2] = -np.sin(heading), np.cos(heading), 1.0
        position = np.stack([x, y, self.height(x, y) + 0.05], -1)
        zero = np.zeros((n, 3))
        return SwarmState(
            position, rotation, zero, zero, np.zeros(n), self.links, np.zeros((n, 4)), self.odometry
        )

    def read(self) -> Percepts:
        x, y, heading = self.pose.T
        ahead = self.height(x + 0.15 * np.cos(heading), y + 0.15 * np.sin(heading))
        drop = np.maximum(self.height(x, y) - ahead, 0.0)
        pitch, roll = self.tilt
        return Percepts(
            proximity=self._proximity(),
            drop=np.where(np.abs(pitch) > 0.1, np.where(drop > 0.1, drop, 0.0), drop),
            pitch=pitch,
            roll=roll,
            odometry=self.odometry,
            docked=self.docked,
            beacon=self._hear(self.words.is_beacon, self.words.accepts),
            guide=self._hear(self.words.is_guide, None),
            asker=self._hear(self.words.asker >= 0, None),
            wired=self._wired(),
        )

    def _proximity(self) -> np.ndarray:
        result = np.full((self.num_robots, 4, 2), 0.2)
        for i in range(self.num_robots):
            for j in range(self.num_robots):
                if i == j:
                    continue
                way = self.pose[j, :2] - self.pose[i, :2]
                gap, bearing = np.hypot(*way) - 0.105, wrap(np.arctan2(way[1], way[0]) - self.pose[i, 2])
                side = int(np.argmin(np.abs(wrap(bearing - SIDE_ANGLES))))
                result[i, side] = np.minimum(result[i, side], max(gap, 0.0))
        return result.reshape(-1, 8)

    def _hear(self, speaks: np.ndarray, accepts: np.ndarray | None) -> Heard:
        place, angle = self._docks()
        heard = {name: value.copy() for name, value in Heard.make_nothing(self.num_robots)._asdict().items()}
        best = np.full(self.num_robots, np.inf)
        for j, b in np.argwhere(speaks):
            for i in range(self.num_robots):
                way = place[j, b] - self.pose[i, :2]
                bearing = wrap(np.arctan2(way[1], way[0]) - self.pose[i, 2])
                reach = REACH[int(np.argmin(np.abs(wrap(bearing - SIDE_ANGLES))))]
                distance = np.hypot(*way) - reach
                departure = wrap(np.arctan2(-way[1], -way[0]) - angle[j, b])
                if i == j or abs(departure) > CONE or distance > min(RANGE, best[i]):
                    continue
                best[i] = distance
                values = (True, distance, bearing, departure, b, self.words.role[j, b])
                heard["is_heard"][i], heard["distance"][i], heard["bearing"][i], heard["departure"][i] = (
                    values[:4]
                )
                heard["sender_side"][i], heard["role"][i] = values[4:]
                for name in ("accepts", "leader", "asker", "size"):
                    heard[name][i] = getattr(self.words, name)[j, b]
        noise = self.rng.normal(0.0, self.noise, (2, self.num_robots))
        heard["bearing"] += noise[0]
        heard["departure"] += 2 * noise[1]
        return Heard(**heard)

    def _wired(self) -> Wired:
        words = [np.zeros((self.num_robots, 4), np.int64) for _ in Wired._fields]
        for link in self.links if self.wire else ():
            for (one, side), (other, _) in (link.ends, link.ends[::-1]):
                for word, told in zip(words, self.wire, strict=True):
                    word[one, SIDES.index(side)] = told[other, 0]
        return Wired(*words)


def scatter(num_robots: int, course: Course, seed: int) -> np.ndarray:
    """Return poses on the near floor, not closer than 0.25 m."""
    rng, poses = np.random.default_rng(seed), []
    low, high = -course.length / 2 + 0.15, course.ramp_feet[0] - 0.1
    while len(poses) < num_robots:
        pose = [rng.uniform(low, high), rng.uniform(-0.8, 0.8), rng.uniform(-np.pi, np.pi)]
        if all(np.hypot(pose[0] - p[0], pose[1] - p[1]) > 0.25 for p in poses):
            poses.append(pose)
    return np.array(poses)
