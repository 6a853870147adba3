"""What a task finds on a surface by itself: the way across it, gaps, steps, stairs and ramps."""

from symbrion_gym._src.tasks.features.gap import Gap, GapSearch, find_gap
from symbrion_gym._src.tasks.features.ramp import Ramp, RampSearch, find_ramp
from symbrion_gym._src.tasks.features.stairs import Stairs, Step, StepSearch, find_stairs, find_step
from symbrion_gym._src.tasks.features.way import Way, WaySearch, find_way

__all__ = [
    "Gap",
    "GapSearch",
    "Ramp",
    "RampSearch",
    "Stairs",
    "Step",
    "StepSearch",
    "Way",
    "WaySearch",
    "find_gap",
    "find_ramp",
    "find_stairs",
    "find_step",
    "find_way",
]
