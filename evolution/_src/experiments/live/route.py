"""Where a Scout goes to see a course that may have changed, and where it looks."""

from __future__ import annotations

import numpy as np

from evolution._src.experiments.live.drive import Plan, Stop
from evolution._src.experiments.live.scene import Box, SceneConfig

_STEP = 0.05
"""Between two looks down from the ramp [m]: the rings of two neighboring beams meet."""
_FULL_EVERY = 5
"""Every so many stops on the ramp it looks all around: the ramp itself may have changed."""
_LOOKS = 11
"""At the far wall, along the edge of the pit."""


def plan_round(scene: SceneConfig) -> Plan:
    """Return where the Scout goes: over the old box's place, around the new box, on the ramp, along the pit.

    It looks around at each stop by turning on the spot: its laser has one vertical fan of beams. From the ramp, which
    it drives up backwards, it looks back over the floor: only from there it sees what lies on top of boxes.

    Args:
        scene: what may have changed.
    """
    course = scene.course
    start = -course.length / 2 + 0.6
    plan: Plan = [Stop(start, 0.0, np.pi)]
    if scene.old_box is not None:
        plan += [*_cross(scene.old_box), Stop(start, 0.0, 0.5)]
    if scene.new_box is not None:
        plan += _go_around(scene.new_box)
    return plan + _look_back(scene) + _look_over_pit(scene)


def _cross(box: Box) -> Plan:
    """Return stops on the place where a box was: beams that rise from there show that its top is gone, too."""
    (x, _), (y, _) = box.x, box.y
    places = ((0.35, 0.5), (0.45, 0.2), (0.3, 0.1), (0.15, 0.2), (0.2, 0.45))
    return [Stop(x + dx, y + dy, np.pi) for dx, dy in places]


def _go_around(box: Box) -> Plan:
    x, y = box.x, box.y
    left, right, back, full = y[1] + 0.2, y[0] - 0.2, x[0] - 0.2, np.pi
    return [
        Stop(back, right, full),
        Stop(back, y[0], full),
        Stop(back, left, full),
        Stop(x[0] + 0.05, left, full),
        Stop(back, left, 0.5),
        Stop(back, right, 0.5),
        Stop(x[1] - 0.15, right, full),
    ]


def _look_back(scene: SceneConfig) -> Plan:
    """Return stops up the ramp and on the plateau, backwards: with the floor and its boxes in sight."""
    course, box = scene.course, scene.new_box
    foot, edge = course.ramp_feet[0], course.pit_edges[0]
    y = 0.15 if box is None else float(np.mean(box.y))
    aim = (foot - 0.3, y) if box is None else (float(np.mean(box.x)), y)
    places = np.arange(foot + 0.25, edge - 0.2, _STEP)
    sweeps = np.where(np.arange(len(places)) % _FULL_EVERY == 0, np.pi, 0.4)
    up = [
        Stop(float(x), y, float(sweep), aim, is_backward=True)
        for x, sweep in zip(places, sweeps, strict=True)
    ]
    return [Stop(foot + 0.2, y, 0.4, aim), *up]


def _look_over_pit(scene: SceneConfig) -> Plan:
    course = scene.course
    x, side = course.pit_edges[0] - 0.12, course.width / 2 - 0.2
    return [Stop(x, float(y), 1.0, (x + 1.0, float(y))) for y in np.linspace(-side, side, _LOOKS)]
