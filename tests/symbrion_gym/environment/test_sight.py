"""The camera sees the robot: it turns away from hills and walls, and looks through ceilings from above."""

import mujoco
import numpy as np
import trimesh

from symbrion_gym._src.arenas.spec import SURFACE_GROUP
from symbrion_gym._src.environment.rendering import Sight, View

WANTED = View(90.0, -20.0, 1.5)
TARGET = np.array([0.0, 0.0, 0.1])


def make_sight(*parts: trimesh.Trimesh) -> Sight:
    spec = mujoco.MjSpec()
    floor = trimesh.Trimesh([[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]], [[0, 1, 2], [0, 2, 3]])
    mesh = trimesh.util.concatenate([floor, *parts])
    spec.add_mesh(
        name="surface",
        uservert=np.asarray(mesh.vertices).ravel(),
        userface=np.asarray(mesh.faces, dtype=np.int32).ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname="surface", group=SURFACE_GROUP, contype=0, conaffinity=0
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return Sight(model, data)


def make_box(extents: list[float], middle: list[float]) -> trimesh.Trimesh:
    box = trimesh.creation.box(extents)
    box.apply_translation(middle)
    return box


def test_a_wall_between_turns_the_camera_and_a_film_does_not_jump_back_and_forth():
    sight = make_sight(make_box([1.0, 0.1, 2.0], [0.0, -1.0, 1.0]))  # azimuth 90 looks along y, from y = -1.4
    found = sight.find_view(TARGET, WANTED)
    assert found.azimuth == 90.0 + 30.0
    assert found.distance == WANTED.distance
    other = View(90.0 - 30.0, -20.0, 1.5)
    assert sight.find_view(TARGET, WANTED, other) == other


def test_within_a_ring_of_walls_the_camera_looks_down_more_steeply():
    ring = trimesh.creation.annulus(0.8, 0.9, 0.6)
    ring.apply_translation([0.0, 0.0, 0.3])
    found = make_sight(ring).find_view(TARGET, WANTED)
    assert found == View(90.0, -40.0, 1.5)


def test_a_free_view_stays_and_a_ceiling_seen_from_above_hides_nothing():
    assert make_sight().find_view(TARGET, WANTED) == WANTED
    room = make_box([2.0, 2.0, 0.4], [0.0, 0.0, 0.2])
    room.invert()
    assert make_sight(room).find_view(TARGET, WANTED) == WANTED


def test_where_nothing_is_free_the_camera_comes_nearer():
    found = make_sight(make_box([1.6, 1.6, 1.4], [0.0, 0.0, 0.1])).find_view(TARGET, WANTED)
    assert 0.3 <= found.distance < 1.1


def test_a_body_bent_over_an_edge_is_seen_though_its_middle_lies_in_the_ground():
    sight = make_sight(make_box([1.0, 2.0, 0.25], [-0.5, 0.0, 0.125]))
    body = np.array([[-0.3, 0.0, 0.30], [-0.1, 0.0, 0.30], [0.06, 0.0, 0.15], [0.06, 0.0, 0.05]])
    middle = body.mean(axis=0)
    assert sight.find_view(middle, WANTED, None, body) == WANTED
    assert sight.find_view(middle, WANTED) != WANTED, "the middle alone is hidden"
