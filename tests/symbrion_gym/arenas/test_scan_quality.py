"""Quality of an arena against its scan: beams, free space, dropped readings."""

from dataclasses import replace

import numpy as np
import trimesh

from symbrion_gym._src.arenas.making import add_scan_quality, simulate_readings
from symbrion_gym._src.arenas.scanned import ScannedSurface
from symbrion_gym._src.contact.quality import ArenaQuality

GROUND = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]])
SLAB = [trimesh.creation.box(bounds=[[0, 0, -0.2], [4, 2, 0]])]
QUALITY = ArenaQuality(0.0, 0.0, 0.0, 1)
POINTS = np.random.default_rng(0).uniform([0, 0, 0], [4, 2, 0], (2000, 3))


def test_without_viewpoints_nothing_is_known_of_beams():
    assert add_scan_quality(QUALITY, ScannedSurface(GROUND), SLAB, GROUND) == QUALITY
    scanned = ScannedSurface(GROUND, points=POINTS, dropped=0.2)
    assert add_scan_quality(QUALITY, scanned, SLAB, GROUND) == replace(QUALITY, dropped=0.2)


def test_with_viewpoints_beams_are_compared():
    scanned = ScannedSurface(GROUND, points=POINTS, viewpoints=np.array([[2.0, 1.0, 1.0]]))
    for each in (scanned, replace(scanned, points=None)):
        quality = add_scan_quality(QUALITY, each, SLAB, GROUND)
        assert (quality.beams_contact, quality.beams_surface, quality.free_space) == (1.0, 1.0, 0.0)
        assert quality.dropped is None


def test_simulated_readings_are_what_a_viewpoint_sees():
    table = trimesh.creation.box(bounds=[[1, 0.5, 0.5], [2, 1.5, 0.6]])
    scene = trimesh.Trimesh(
        np.concatenate([GROUND.vertices, table.vertices]), np.concatenate([GROUND.faces, table.faces + 4])
    )
    viewpoints = np.array([[1.5, 1.0, 2.0], [1.5, 1.0, 0.3]])
    points, seen_from = simulate_readings(scene, viewpoints, 5000)
    from_above = points[seen_from == 0]
    is_under = (np.abs(from_above[:, :2] - [1.5, 1.0]) < 0.5).all(axis=1) & (from_above[:, 2] < 0.01)
    assert not is_under.any()
    below = points[seen_from == 1]
    assert (np.abs(below[:, :2] - [1.5, 1.0]) < 0.5).all(axis=1).any()
    assert not (below[:, 2] > 0.55).any()
