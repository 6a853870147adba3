"""Boxes in place of contact pieces: only where a robot could not tell."""

import mujoco
import numpy as np
import pytest
import trimesh

from symbrion_gym.arenas.arena import load_arena
from symbrion_gym.arenas.spec import CONTACT_GROUP
from symbrion_gym.arenas.stretch import stretch_arena
from symbrion_gym.environment.box_contacts import TOLERANCE, find_boxes
from symbrion_gym.environment.snake_pit import SnakePitEnv


def _make_block(x, y, z):
    """Return a block between the given limits."""
    (x0, x1), (y0, y1), (z0, z1) = x, y, z
    corners = [(a, b, c) for a in (x0, x1) for b in (y0, y1) for c in (z0, z1)]
    return trimesh.convex.convex_hull(np.array(corners))


FLOOR = _make_block((-2, 2), (-1, 1), (-0.2, 0))


def _make_hump(rise=0.2):
    """Return a plateau of 0.5 m with a ramp of 1 m up to it."""
    side = [(-1.0, 0.0), (0.5, 0.0), (0.5, rise), (0.0, rise)]
    return trimesh.convex.convex_hull(np.array([(x, y, z) for x, z in side for y in (-1.0, 1.0)]))


def _is_in(boxes, point):
    return any((box.planes[:, :3] @ point <= box.planes[:, 3]).all() for box in boxes)


def test_a_ramp_and_a_plateau_are_two_boxes():
    boxes = find_boxes([FLOOR, _make_hump()])
    assert [len(boxes[i]) for i in (0, 1)] == [1, 2]
    for point, is_solid in [
        ((-0.5, 0.5, 0.098), True),
        ((-0.5, 0.5, 0.102), False),
        ((0.25, -0.5, 0.198), True),
        ((0.25, -0.5, 0.202), False),
        ((0.498, 0.0, 0.05), True),
        ((0.502, 0.0, 0.05), False),
    ]:
        assert _is_in([*boxes[0], *boxes[1]], np.array(point)) is is_solid


def test_what_is_no_box_stays():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.3)
    assert find_boxes([FLOOR, ball]).keys() == {0}


def test_a_roof_is_no_deeper_than_it_is():
    roof = _make_block((-0.3, 0.3), (-0.5, 0.5), (0.2, 0.25))
    (box,) = find_boxes([FLOOR, roof])[1]
    np.testing.assert_allclose(2 * box.half_sizes[2], 0.05, atol=1e-6)
    wedge = trimesh.convex.convex_hull(np.add(_make_hump().vertices, (0.0, 0.0, 0.2)))
    assert 1 not in find_boxes([FLOOR, wedge])


@pytest.mark.parametrize("name", ["truth", "gsrm", "gg"])
@pytest.mark.parametrize("factor", [0.95, 1.0, 1.05])
def test_a_robot_touches_boxes_in_the_ready_made_arenas(name, factor):
    arena = stretch_arena(load_arena(name), factor)
    model = SnakePitEnv(arena=arena, modules=2).model
    is_piece = model.geom_group == CONTACT_GROUP
    assert (model.geom_type[is_piece] == mujoco.mjtGeom.mjGEOM_BOX).all()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    model.geom_rgba[is_piece, 3] = 1.0
    group = (np.arange(6) == CONTACT_GROUP).astype(np.uint8)
    found, hit = [], np.zeros(1, dtype=np.int32)
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-2.5, 2.5, 61), (-0.8, 0.0, 0.8)))
    for place in zip(x, y, strict=True):
        start, down = np.array([*place, 1.0]), np.array([0.0, 0.0, -1.0])
        found.append(1.0 - mujoco.mj_ray(model, data, start, down, group, 1, -1, hit))
    known = np.max([_find_top(piece, x, y) for piece in arena.pieces], axis=0)
    assert np.percentile(np.abs(found - known), 98) < TOLERANCE


def _find_top(piece, x, y):
    """Return the height of a convex piece; -inf beside it."""
    n, offset = piece.face_normals, (piece.face_normals * piece.triangles[:, 0]).sum(axis=1)
    rest = offset - np.outer(x, n[:, 0]) - np.outer(y, n[:, 1])
    up, down, level = n[:, 2] > 1e-6, n[:, 2] < -1e-6, np.abs(n[:, 2]) <= 1e-6
    high, low = (rest[:, up] / n[up, 2]).min(axis=1), (rest[:, down] / n[down, 2]).max(axis=1)
    return np.where((low <= high) & (rest[:, level] >= 0).all(axis=1), high, -np.inf)
