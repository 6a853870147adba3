"""Quality of an arena against its scan: beams, free space, dropped readings."""

import numpy as np
import pytest
import trimesh

from reconstruction.scans.cloud import Cloud
from symbrion_gym.arenas.scan_quality import add_scan_quality, simulate_readings
from symbrion_gym.contact.quality import ArenaQuality

GROUND = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]])
SLAB = [trimesh.creation.box(bounds=[[0, 0, -0.2], [4, 2, 0]])]
QUALITY = ArenaQuality(0.0, 0.0, 0.0, 1)
POINTS = np.random.default_rng(0).uniform([0, 0, 0], [4, 2, 0], (2000, 3))


def test_without_viewpoints_only_dropped_readings_are_counted():
    assert add_scan_quality(QUALITY, Cloud(POINTS), None, SLAB, GROUND) == QUALITY
    near = add_scan_quality(QUALITY, Cloud(POINTS), POINTS[POINTS[:, 0] < 2], SLAB, GROUND)
    assert near.dropped == pytest.approx(0.475, abs=0.02)  # all beyond 2.1 m
    assert near.beams_contact is None
    whole = add_scan_quality(QUALITY, Cloud(POINTS), POINTS, SLAB, GROUND)
    assert whole.dropped == 0.0


def test_with_viewpoints_beams_are_compared():
    readings = Cloud(POINTS, viewpoints=np.array([[2.0, 1.0, 1.0]]))
    quality = add_scan_quality(QUALITY, readings, None, SLAB, GROUND)
    assert (quality.beams_contact, quality.beams_surface, quality.free_space) == (1.0, 1.0, 0.0)
    assert quality.dropped is None


def test_simulated_readings_are_what_a_viewpoint_sees():
    table = trimesh.creation.box(bounds=[[1, 0.5, 0.5], [2, 1.5, 0.6]])
    scene = trimesh.Trimesh(
        np.concatenate([GROUND.vertices, table.vertices]), np.concatenate([GROUND.faces, table.faces + 4])
    )
    viewpoints = np.array([[1.5, 1.0, 2.0], [1.5, 1.0, 0.3]])
    readings = simulate_readings(scene, viewpoints, 5000)
    assert readings.seen_from is not None
    from_above = readings.points[readings.seen_from == 0]
    hidden = (np.abs(from_above[:, :2] - [1.5, 1.0]) < 0.5).all(axis=1) & (from_above[:, 2] < 0.01)
    assert not hidden.any()
    below = readings.points[readings.seen_from == 1]
    assert (np.abs(below[:, :2] - [1.5, 1.0]) < 0.5).all(axis=1).any()
    assert not (below[:, 2] > 0.55).any()
