"""Docking trials of pairs of robots, as on the hardware: python -m benchmarks.docking [--trials 114] [--seed 0]

The coordinates of the hardware's start positions are not known: `DISTANCES` were fitted to the times of trials without
recoveries. The other conditions of the start are estimates.
"""

from __future__ import annotations

import argparse
from math import radians
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.progress import Progress, silent
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.swarm.behavior.machine import BehavingSwarm, Machine
from symbrion_gym._src.swarm.behavior.memory import Memory, Mode, make_plan, make_ticket
from symbrion_gym._src.swarm.behavior.sensing import make_scout
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.world import DECISION

DISTANCES = (1.15, 0.88, 0.62)
"""From the recruiter's dock to the center of the other robot, positions 1 to 3 [m]."""
SIDES = (radians(10), 0.0, radians(-10))
"""Of positions 1 to 3, left, middle and right, from the axis of the dock [rad]."""
HEADINGS = (radians(45), radians(135), radians(-45), radians(-135))
"""Of positions 4 (as 2) and 5 (as 3), off the direction to the dock, in turn [rad]."""
SPREAD = (0.01, 0.05)  # Standard deviations of start position [m] and heading [rad]
DURATION = 240.0
"""A trial that takes longer has failed [s]; the longest of the robots took 242 s in all."""
APART = 5.0  # Distance between pairs, which all run at once [m]: farther than a beacon is heard
CHECK_EVERY = 10  # Decisions between two looks at who has locked
DOCK = 0.0525  # From the center of a robot to its back dock [m]


class DockingTimes(NamedTuple):
    """Results of docking trials, one row each."""

    position: Int[np.ndarray, " T"]  # start position, 1 to 5 as in the hardware's trials
    locked: Bool[np.ndarray, " T"]  # whether the front dock locked
    seconds: Float[np.ndarray, " T"]  # from LocateBeacon to Locking [s]; nan where it did not lock
    recoveries: Int[np.ndarray, " T"]  # failed attempts


def run_docking_trials(
    positions: Int[np.ndarray, " T"], seed: int = 0, noise: float = 1.0, progress: Progress = silent
) -> DockingTimes:
    """Run trials from start positions, all at once and out of each other's hearing, on level ground.

    `noise` is a factor on the errors of what robots sense and hear.
    """
    count = len(positions)
    rows = int(np.ceil(np.sqrt(count)))
    floor = Course(pit=0.0, floor=APART * (rows + 1), width=APART * (rows + 1))
    world = KinematicWorld(Arena.from_course(floor, "floor"), 2 * count, make_scout())
    world.reset(_place(positions, rows, np.random.default_rng((seed, 5))), seed)
    machine = Machine(make_plan(snake(2)), 2 * count)
    swarm = BehavingSwarm(world, machine, noise, seed, _begin(count))
    seconds, recoveries = np.full(count, np.nan), np.zeros(count, np.int64)
    steps = round(DURATION / DECISION)
    for step in range(steps):
        swarm.step()
        is_new = np.isnan(seconds) & (swarm.memory.mode[1::2] == Mode.LOCK)
        seconds = np.where(is_new, world.time, seconds)
        recoveries = np.where(np.isnan(seconds) | is_new, swarm.memory.recoveries[1::2], recoveries)
        if step % CHECK_EVERY == 0:
            progress("docking trials", step / steps)
            if not np.isnan(seconds).any():
                break
    return DockingTimes(np.asarray(positions), ~np.isnan(seconds), seconds, recoveries)


def _place(positions: Int[np.ndarray, " T"], rows: int, rng: np.random.Generator) -> Float[np.ndarray, "M 3"]:
    """Return poses of recruiters (even rows) and of the robots that come (odd rows)."""
    count = len(positions)
    grid = np.stack(np.divmod(np.arange(count), rows), axis=-1) * APART
    first = Course(pit=0.0).ramp_feet[0] - APART
    recruiter = np.stack([first - grid[:, 0], grid[:, 1] - APART * (rows - 1) / 2], axis=-1)
    like = np.where(positions > 3, positions - 2, positions) - 1
    distance, side = np.array(DISTANCES)[like], np.array(SIDES)[like]
    turn = np.where(positions > 3, np.resize(HEADINGS, count), 0.0)
    poses, noise = np.zeros((2 * count, 3)), rng.standard_normal((count, 3))
    way = np.stack([-np.cos(side), np.sin(side)], axis=-1)
    poses[::2, :2] = recruiter
    poses[1::2, :2] = recruiter - [DOCK, 0.0] + distance[:, None] * way + SPREAD[0] * noise[:, :2]
    poses[1::2, 2] = -side + turn + SPREAD[1] * noise[:, 2]
    return poses


def _begin(count: int) -> Memory:
    """Return the memory of pairs: one recruits and has accepted the other."""
    numbers = np.arange(2 * count)
    even = numbers % 2 == 0
    memory = Memory.begin(2 * count).start(even, Mode.RECRUIT, role=0, leader=numbers[even], roles=1)
    memory = memory.start(~even, Mode.LOCATE_BEACON)
    accepted = np.where(even, make_ticket(np.ones_like(numbers), numbers + 1), 0)
    return memory._replace(ticket=accepted, unseen=np.zeros(2 * count), silent=np.zeros(2 * count))


def main() -> None:
    """Run trials, and print their times beside those of 114 trials of real Scouts (symbrion-morph, data_set31)."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=114)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    times = run_docking_trials(1 + np.arange(options.trials) % 5, options.seed)
    low, middle, high = np.nanpercentile(times.seconds, (10, 50, 90))
    print(f"locked {times.locked.sum()} of {options.trials} (real Scouts: 111 of 114)")
    print(f"median {middle:.1f} s, 10-90 % {low:.0f}-{high:.0f} (real Scouts: 35.2, 19-102)")
    print(f"recoveries {times.recoveries.mean():.1f} (real Scouts: 1.9)")


if __name__ == "__main__":
    main()
