"""MJCF: MuJoCo alone loads it, with the shapes that the arena itself has, alone and within other models."""

import mujoco
import numpy as np
import pytest
from exported import make_field_arena, make_mixed_arena

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course

ROBOT = """<mujoco><compiler angle="degree"/>{include}<worldbody><body name="ball" pos="4.3 1.5 1.5"><freejoint/>
<geom type="sphere" size="0.05"/></body></worldbody></mujoco>"""


def cast_rays(model: mujoco.MjModel, group: int) -> np.ndarray:
    """Return the distances of vertical rays, off all rims, from 3 m above to the geoms of a group; -1 for none."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
    groups[group] = 1
    x, y = np.meshgrid(np.linspace(-0.913, 6.871, 37), np.linspace(-1.887, 2.861, 23))
    down, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, dtype=np.int32)
    return np.array(
        [
            mujoco.mj_ray(model, data, np.array([*p, 3.0]), down, groups, 1, -1, geom)
            for p in zip(x.flat, y.flat, strict=True)
        ]
    )


@pytest.mark.parametrize("make", [make_mixed_arena, make_field_arena, lambda: Arena.from_course(Course())])
@pytest.mark.parametrize("limit", [None, 64])
def test_an_export_is_the_arena(tmp_path, make, limit):
    arena = make()
    arena.export(tmp_path / "out", "mjcf", limit)
    exported = mujoco.MjModel.from_xml_path(str(tmp_path / "out/arena.xml"))
    own = arena.spec().compile()
    for group in (2, 3):
        assert np.allclose(cast_rays(exported, group), cast_rays(own, group), atol=3e-4 if limit else 2e-6)
    contact = exported.geom_group == 3
    assert np.allclose(exported.geom_friction[contact], own.geom_friction[own.geom_group == 3][0])
    assert (exported.geom_contype[contact] == 1).all()
    assert not exported.geom_contype[~contact].any()
    assert exported.nv == 0


def test_boxes_stay_boxes_and_hulls_are_within_the_limit(tmp_path):
    about = make_mixed_arena().export(tmp_path / "out", "mjcf", 64)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out/contact.xml"))
    assert (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX).sum() == 2
    assert model.mesh_vertnum.max() <= 64
    assert about["num_pieces"] == 4
    assert about["num_solids"] == model.ngeom > 4
    assert 0 <= about["deviation"] <= 2e-4


def test_the_file_is_included_from_another_folder(tmp_path):
    make_mixed_arena().export(tmp_path / "out", "mjcf")
    path = tmp_path / "robot.xml"
    path.write_text(ROBOT.format(include='<include file="out/arena.xml"/>'))
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    touched = set()
    for _ in range(500):
        mujoco.mj_step(model, data)
        touched |= {model.geom(geom).name for contact in data.contact for geom in contact.geom}
    assert "arena_piece_002" in touched, "the ball falls on the wedge"
    assert "arena_surface" not in touched


def test_the_body_is_attached_twice(tmp_path):
    make_mixed_arena().export(tmp_path / "out", "mjcf")
    spec = mujoco.MjSpec.from_string(ROBOT.format(include=""))
    for i in range(2):
        arena = mujoco.MjSpec.from_file(str(tmp_path / "out/contact.xml"))
        frame = spec.worldbody.add_frame(pos=[0, 10 * i, 0])
        frame.attach_body(arena.body("arena"), f"copy_{i}/", "")
    model = spec.compile()
    assert model.body("copy_1/arena").pos[1] == 10
    assert model.ngeom == 1 + 2 * mujoco.MjModel.from_xml_path(str(tmp_path / "out/contact.xml")).ngeom
