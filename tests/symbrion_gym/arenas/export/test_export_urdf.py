"""URDF: read by the standard, by MuJoCo's importer and by yourdfpy, it has the shapes of the arena."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from exported import make_field_arena, make_mixed_arena

from symbrion_gym._src.arenas.export.formats import make_content
from symbrion_gym._src.errors import ArenaError


@pytest.fixture
def folder(tmp_path) -> Path:
    make_mixed_arena().export(tmp_path / "out", "urdf")
    return tmp_path / "out"


def find_solids() -> list[trimesh.Trimesh]:
    return [solid.mesh for solid in make_content(make_mixed_arena().geometry, 64).solids]


def read_collisions(path: Path) -> list[trimesh.Trimesh]:
    """Read the collision elements as the standard of URDF says."""
    meshes = []
    for element in ElementTree.parse(path).getroot().findall("link/collision"):
        (shape,) = element.find("geometry")
        if shape.tag == "box":
            mesh = trimesh.creation.box([float(value) for value in shape.get("size").split()])
        else:
            mesh = trimesh.load_mesh(path.parent / shape.get("filename"), process=False)
        origin = element.find("origin")
        if origin is not None:
            position, angles = ([float(v) for v in origin.get(name).split()] for name in ("xyz", "rpy"))
            transform = trimesh.transformations.euler_matrix(*angles, "sxyz")
            transform[:3, 3] = position
            mesh.apply_transform(transform)
        meshes.append(mesh)
    return meshes


def assert_equal_solids(found: list[trimesh.Trimesh], wanted: list[trimesh.Trimesh]) -> None:
    assert len(found) == len(wanted)
    for a, b in zip(found, wanted, strict=True):
        assert len(a.vertices) == len(b.vertices)
        assert np.allclose(np.sort(_key(a)), np.sort(_key(b)), atol=1e-5)
        assert a.volume == pytest.approx(b.volume, rel=1e-4)


def _key(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return a number a vertex that does not depend on their order."""
    return np.asarray(mesh.vertices) @ [1.0, np.sqrt(2.0), np.sqrt(3.0)]


def test_collisions_are_the_pieces(folder):
    assert_equal_solids(read_collisions(folder / "arena.urdf"), find_solids())


def test_mujoco_imports_it(folder):
    model = mujoco.MjModel.from_xml_path(str(folder / "arena.urdf"))
    solids = find_solids()
    assert (model.geom_contype > 0).sum() == len(solids)
    assert model.ngeom == len(solids) + 1  # and the surface, as a visual
    assert model.nv == 0


def test_a_height_field_is_refused_with_what_would_do(tmp_path):
    with pytest.raises(
        ArenaError, match="'field' is a height field, which URDF does not have; export it to mjcf"
    ):
        make_field_arena().export(tmp_path / "out", "urdf")
    assert not (tmp_path / "out").exists()
