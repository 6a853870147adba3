"""Energy of robots: what they spend, and what docked ones share. A simple balance, without voltages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.swarm.world import DECISION

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from symbrion_gym._src.robot.organism import Docking
    from symbrion_gym._src.swarm.world import SwarmCommands, SwarmState

_LARGEST_SHARE = 0.2
"""Of the difference between two modules that flows in a decision at most: with four neighbors it never swings."""


@dataclass(frozen=True)
class BatteryConfig:
    """Energy of a Scout. All numbers are estimates of ours: none is in the sources at hand.

    Attributes:
        capacity: of a full battery [J]; 28 Wh.
        idle_power: of computers and sensors [W].
        drive_power: of both tracks at full speed, in proportion to their speeds [W].
        hinge_power: of a hinge that moves at its full speed, in proportion to it [W].
        share_power: largest flow through a docking [W].
        share_efficiency: share of that flow that arrives.

    Raises:
        OptionError: a value is out of range.
    """

    capacity: float = 100_000.0
    idle_power: float = 4.0
    drive_power: float = 3.0
    hinge_power: float = 8.0
    share_power: float = 10.0
    share_efficiency: float = 0.9

    def __post_init__(self) -> None:
        check_positive(self, ("capacity",), OptionError)
        names = ("idle_power", "drive_power", "hinge_power", "share_power", "share_efficiency")
        check_not_negative(self, names, OptionError)
        if self.share_efficiency > 1.0:
            raise OptionError(
                f"BatteryConfig.share_efficiency must be at most 1, got {self.share_efficiency!r}"
            )


class Batteries:
    """Charges of N robots.

    Attributes:
        charge: `[N]` [J].
    """

    def __init__(
        self,
        num_robots: int,
        config: BatteryConfig | None = None,
        charge: Float[np.ndarray, " N"] | float = 1.0,
    ) -> None:
        """Charge the batteries."""
        self.config = config or BatteryConfig()
        share = np.broadcast_to(np.asarray(charge, dtype=np.float64), (num_robots,))
        if not ((share >= 0.0) & (share <= 1.0)).all():
            raise OptionError(f"charge must be shares of the capacity between 0 and 1, got {charge!r}")
        self.charge = share * self.config.capacity

    @property
    def is_empty(self) -> Bool[np.ndarray, " N"]:
        """Whether each robot has no energy left."""
        return self.charge <= 0.0

    def limit(self, commands: SwarmCommands, state: SwarmState) -> SwarmCommands:
        """Return commands in which robots without energy stand still; latches hold without energy."""
        empty = self.is_empty
        return commands._replace(
            tracks=np.where(empty[:, None], 0.0, commands.tracks),
            hinge=np.where(empty, state.hinge, commands.hinge),
        )

    def step(
        self,
        before: SwarmState,
        after: SwarmState,
        track_speed: float,
        hinge_speed: float,
        duration: float = DECISION,
    ) -> None:
        """Spend what a step took, then share between docked robots."""
        config = self.config
        run = np.abs(after.odometry - before.odometry).mean(axis=1) / track_speed
        bend = np.abs(after.hinge - before.hinge) / hinge_speed
        spent = config.idle_power * duration + config.drive_power * run + config.hinge_power * bend
        self.charge = np.maximum(self.charge - spent, 0.0)
        self._share(after.links, duration)

    def _share(self, links: tuple[Docking, ...], duration: float) -> None:
        """Let energy flow from fuller modules to emptier ones that are docked to them."""
        if not links:
            return
        first, second = np.array([(link.first, link.second) for link in links]).T
        difference = self.charge[first] - self.charge[second]
        most = self.config.share_power * duration
        flow = np.clip(_LARGEST_SHARE * difference, -most, most)
        self.charge = self.charge.copy()
        received = np.abs(flow) * self.config.share_efficiency
        np.add.at(self.charge, first, np.where(flow > 0.0, -flow, received))
        np.add.at(self.charge, second, np.where(flow > 0.0, received, flow))
