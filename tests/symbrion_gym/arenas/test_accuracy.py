"""Accuracy wanted and reached: a missed one names the worst place and a remedy."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from symbrion_gym.arenas.accuracy import report_accuracy
from symbrion_gym.contact.quality import ArenaQuality

GROUND = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]])
SLAB = trimesh.creation.box(bounds=[[0, 0, -0.2], [3, 2, 0]])


def make_arena(mean: float, **provenance: object) -> sg.Arena:
    return sg.Arena("a", [SLAB], GROUND, ArenaQuality(mean, mean, 1.0, 1), provenance=provenance)


def test_reached():
    report = report_accuracy(make_arena(0.002, options={"accuracy": 0.003, "max_pieces": 64}))
    assert report.is_reached
    assert (report.wanted, report.reached, report.warnings) == (0.003, 0.002, ())
    assert report.as_dict()["distance"] is None


def test_missed_names_the_worst_place_and_a_remedy():
    report = report_accuracy(make_arena(0.1, options={"accuracy": 0.003, "max_pieces": 1}))
    assert not report.is_reached
    assert report.worst is not None
    assert report.worst[0] == pytest.approx(4.0, abs=0.1)
    assert report.distance == pytest.approx(1.0, abs=0.1)
    assert "100 mm off in the mean; 3 mm was wanted; worst at (4.0" in report.warnings[-1] or (
        "worst at (3.9" in report.warnings[-1]
    )
    assert "raise max_pieces (now 1)" in report.warnings[-1]


def test_too_many_pieces_are_a_miss():
    many = make_arena(0.001, options={"accuracy": 0.003, "max_pieces": 1})
    many = replace(many, quality=replace(many.quality, num_pieces=2))
    assert not report_accuracy(many).is_reached


def test_what_the_making_noted_counts():
    arena = make_arena(
        0.001, accuracy=0.02, is_reached=False, worst={"place": [1, 2, 3], "distance": 0.5}, warnings=["late"]
    )
    report = report_accuracy(arena)
    assert (report.wanted, report.is_reached) == (0.02, False)
    assert (report.worst, report.distance) == ((1.0, 2.0, 3.0), 0.5)
    assert report.warnings[0] == "late"
    assert "(1.00, 2.00, 3.00), 500 mm off" in report.warnings[1]


def test_no_contact_at_all():
    arena = sg.Arena("a", [], GROUND, ArenaQuality(np.inf, np.inf, np.inf, 0))
    report = report_accuracy(replace(arena, provenance={"options": {"accuracy": 0.01}}))
    assert not report.is_reached
    assert "every place" in report.warnings[-1]
    assert report.as_dict()["reached"] is None
