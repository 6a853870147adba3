"""Descriptors of bodies, which tell kinds of them apart."""

from __future__ import annotations

import numpy as np

from evolution.bodies.genome import BodyGenome

MAX_WIDTH_TO_LENGTH = 2.0
"""Wider bodies count as this wide."""


def find_measures(body: BodyGenome) -> tuple[float, float]:
    """Return the number of modules, and the width to length of the body when its hinges are straight.

    The length is along the root's line of sight. The number of hinges is no descriptor: each docking of an evolved body
    uses one arm, so that it is one less than that of the modules.
    """
    organism = body.to_organism()
    places = np.array([(pose.x, pose.y) for pose in organism.find_poses()])
    length, width = np.ptp(places, axis=0) + organism.scout.size[:2]
    return float(organism.num_modules), float(min(width / length, MAX_WIDTH_TO_LENGTH))
