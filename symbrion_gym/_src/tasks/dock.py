"""The task of docking at a known object, as a docking station or a power socket."""

from __future__ import annotations

from typing import Any

import numpy as np

from symbrion_gym._src.tasks.objects import DockAtObject
from symbrion_gym._src.tasks.route import Point, StartName
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.usual_terms import UsualTerms


def make_dock(
    goal: str = "station",
    tolerance: float = 0.03,
    max_angle: float = float(np.deg2rad(10.0)),
    start: StartName | Point = "floor",
    **terms: Any,
) -> Task:
    """Make the task of docking at a known object with the front dock of the head.

    Success: the dock within the tolerance of the middle of the object's front, ahead and to the side, the head aligned
    with it, every module upright, on the ground, the body no faster than its tracks, for 0.3 s.
    """
    target = DockAtObject(tolerance=tolerance, site=goal, max_angle=max_angle)
    return UsualTerms(**terms).make_task("dock", Start(start), target)
