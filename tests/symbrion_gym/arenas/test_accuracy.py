"""Accuracy wanted and reached, as the making of an arena has noted it."""

import numpy as np
import trimesh

import symbrion_gym as sg
from symbrion_gym._src.arenas.making import report_accuracy
from symbrion_gym._src.contact.quality import ArenaQuality

GROUND = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]])


def make_arena(mean: float, **provenance: object) -> sg.Arena:
    return sg.Arena("a", [], GROUND, ArenaQuality(mean, mean, 1.0, 1), provenance=provenance)


def test_what_the_making_noted():
    arena = make_arena(
        0.03, accuracy=0.02, is_reached=False, worst={"place": [1, 2, 3], "distance": 0.5}, warnings=["late"]
    )
    report = report_accuracy(arena)
    assert (report.wanted, report.reached, report.is_reached) == (0.02, 0.03, False)
    assert (report.worst, report.distance, report.warnings) == ((1, 2, 3), 0.5, ("late",))
    assert report.as_dict()["worst"] == (1, 2, 3)


def test_courses_made_in_code_miss_nothing():
    report = report_accuracy(sg.load_arena("truth"))
    assert report.is_reached
    assert report.wanted is None


def test_no_contact_at_all():
    report = report_accuracy(make_arena(np.inf, accuracy=0.01))
    assert not report.is_reached
    assert report.as_dict()["reached"] is None
