"""What a task finds on a surface by itself: the way across it, gaps, steps, stairs and ramps."""

from symbrion_gym._src.tasks.features.gap import Gap, Ramp, find_gap, find_ramp
from symbrion_gym._src.tasks.features.stairs import Stairs, Step, find_stairs, find_step

__all__ = ["Gap", "Ramp", "Stairs", "Step", "find_gap", "find_ramp", "find_stairs", "find_step"]
