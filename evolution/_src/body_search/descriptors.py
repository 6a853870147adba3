"""Descriptors of bodies and of what they do, which tell kinds of them apart: the axes of an archive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from evolution._src.bodies.genome import BodyGenome
from evolution._src.body_search.learning import Lesson

MAX_WIDTH_TO_LENGTH = 2.0
"""Wider bodies count as this wide."""
MAX_EFFORT = 0.2
"""Larger efforts count as this one: 100 J of the hinges at the usual cost of 0.002 a joule."""
LEAST_SWING = 0.1
"""A hinge whose amplitude and offset are below this is not used [rad]; its play is about as much."""
_SWINGS = ("amplitude", "offset")


def measure_modules(lesson: Lesson) -> float:
    """Return the number of modules."""
    return float(lesson.pupil.body.num_modules)


def measure_width_to_length(lesson: Lesson) -> float:
    """Return the width to length of the body when its hinges are straight; the length is along the root's look."""
    organism = lesson.pupil.body.to_organism()
    places = np.array([(pose.x, pose.y) for pose in organism.find_poses()])
    length, width = np.ptp(places, axis=0) + organism.scout.size[:2]
    return float(min(width / length, MAX_WIDTH_TO_LENGTH))


def measure_used_hinges(lesson: Lesson) -> float:
    """Return how many hinges swing or are held bent by genes of their kind of docking.

    Under a law without such genes all hinges count.
    """
    genes = dict(zip(lesson.names, lesson.genotype, strict=True))
    if not any(name.startswith(f"{swing}_") for name in genes for swing in _SWINGS):
        return lesson.pupil.body.num_modules - 1.0
    return float(sum(_is_used(genes, kind) for kind in _list_dockings(lesson.pupil.body.develop())))


def measure_effort(lesson: Lesson) -> float:
    """Return the mean effort of the exam, the energy of the hinges weighed by its cost."""
    return float(min(lesson.effort, MAX_EFFORT))


class Descriptor(NamedTuple):
    """An axis of an archive.

    Attributes:
        measure: from a lesson to a number.
        limits: from the smallest and the largest number of modules to the number of cells and the ends of the axis.
    """

    measure: Callable[[Lesson], float]
    limits: Callable[[int, int], tuple[int, float, float]]


DESCRIPTORS: Mapping[str, Descriptor] = {
    "modules": Descriptor(measure_modules, lambda least, most: (most - least + 1, least - 0.5, most + 0.5)),
    "width_to_length": Descriptor(measure_width_to_length, lambda least, most: (6, 0.0, MAX_WIDTH_TO_LENGTH)),
    "hinges": Descriptor(measure_used_hinges, lambda least, most: (most, -0.5, most - 0.5)),
    "energy": Descriptor(measure_effort, lambda least, most: (5, 0.0, MAX_EFFORT)),
}
"""Axes by their names, with their cells."""


def _is_used(genes: Mapping[str, float], kind: str) -> bool:
    return any(abs(genes.get(f"{swing}_{kind}", 0.0)) >= LEAST_SWING for swing in _SWINGS)


def _list_dockings(body: BodyGenome) -> list[str]:
    """Return the socket of each docking."""
    return [kind for socket, limb in body.limbs for kind in (socket, *_list_dockings(limb))]
