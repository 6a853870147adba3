"""USD: usd-core opens it, with static colliders of the right shapes; without usd-core the extra is named."""

from pathlib import Path

import numpy as np
import pytest
from exported import make_field_arena, make_mixed_arena

import reconstruction._src.base.extras
from reconstruction._src.base.extras import MissingExtraError


@pytest.fixture
def pxr():
    return pytest.importorskip("pxr", reason="usd-core is not installed: pip install 'symbrion-gym[usd]'")


def open_stage(folder: Path):
    from pxr import Usd

    return Usd.Stage.Open(str(folder / "arena.usda"))


def find_corners(prim) -> np.ndarray:
    """Return the corners of a mesh or cube in the frame of the stage."""
    from pxr import Usd, UsdGeom

    if prim.IsA(UsdGeom.Cube):
        half = UsdGeom.Cube(prim).GetSizeAttr().Get() / 2
        corners = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    else:
        corners = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(), dtype=np.float64)
    matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    return corners @ matrix[:3, :3] + matrix[3, :3]


@pytest.mark.usefixtures("pxr")
def test_colliders_are_the_pieces(tmp_path):
    from pxr import UsdGeom, UsdPhysics, UsdShade

    arena = make_mixed_arena()
    arena.export(tmp_path, "usd", max_vertices=None)
    stage = open_stage(tmp_path)
    prims = stage.GetPrimAtPath("/arena/contact").GetChildren()
    assert len(prims) == len(arena.pieces)
    for prim, piece in zip(prims, arena.pieces, strict=True):
        assert prim.HasAPI(UsdPhysics.CollisionAPI)
        assert prim.IsA(UsdGeom.Cube) == (len(piece.vertices) == 8)
        if prim.IsA(UsdGeom.Mesh):
            approximation = UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get()
            assert approximation == "convexHull"
        found, wanted = find_corners(prim), np.asarray(piece.vertices)
        distances = np.linalg.norm(found[:, None] - wanted, axis=2)
        assert max(distances.min(axis=0).max(), distances.min(axis=1).max()) < 1e-5
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        assert UsdPhysics.MaterialAPI(material).GetDynamicFrictionAttr().Get() == pytest.approx(0.6)
        assert UsdGeom.Imageable(prim).ComputePurpose() == "guide"


@pytest.mark.usefixtures("pxr")
def test_nothing_moves_and_the_surface_touches_nothing(tmp_path):
    from pxr import UsdGeom, UsdPhysics

    arena = make_mixed_arena()
    arena.export(tmp_path, "usd")
    stage = open_stage(tmp_path)
    assert not [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    surface = stage.GetPrimAtPath("/arena/surface")
    assert not surface.HasAPI(UsdPhysics.CollisionAPI)
    assert np.allclose(find_corners(surface), arena.surface.vertices, atol=1e-6)
    faces = np.array(UsdGeom.Mesh(surface).GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    assert np.array_equal(faces, arena.surface.faces)


@pytest.mark.usefixtures("pxr")
def test_a_height_field_collides_by_its_triangles(tmp_path):
    from pxr import UsdPhysics

    arena = make_field_arena()
    arena.export(tmp_path, "usd")
    stage = open_stage(tmp_path)
    (prim,) = stage.GetPrimAtPath("/arena/contact").GetChildren()
    assert UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() == "none"
    assert np.allclose(find_corners(prim), arena.height_field.as_mesh().vertices, atol=1e-6)


def test_without_usd_core_the_extra_is_named(tmp_path, monkeypatch):
    found = reconstruction._src.base.extras.find_spec
    monkeypatch.setattr(
        reconstruction._src.base.extras, "find_spec", lambda name: None if name == "pxr" else found(name)
    )
    with pytest.raises(MissingExtraError, match=r"pip install 'symbrion-gym\[usd\]'"):
        make_mixed_arena().export(tmp_path / "out", "usd")
    assert not (tmp_path / "out").exists()
