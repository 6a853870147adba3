"""USD with the physics schema: static colliders for Isaac Sim, Isaac Lab, Newton and every other reader of UsdPhysics.

Colliders without a rigid body are static. Pieces have the purpose "guide": renderers show the surface alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from reconstruction._src.base.extras import require_extras
from reconstruction._src.surfaces.color import WHITE, find_vertex_colors
from symbrion_gym._src.arenas.export.content import Content, Solid
from symbrion_gym._src.arenas.spec import SURFACE_COLOR

ROOT = "/arena"  # Path of the default prim, which holds everything


def format_usd(content: Content) -> dict[str, bytes]:
    """Return `arena.usda`."""
    require_extras("export to usd", "usd")
    from pxr import Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT).GetPrim())
    material = _add_material(stage, "ground", content.friction)
    materials = {None: material} | {
        friction: _add_material(stage, f"patch_{i}", friction)
        for i, friction in enumerate(dict.fromkeys(solid.friction for solid in content.solids))
        if friction is not None
    }
    contact = UsdGeom.Xform.Define(stage, f"{ROOT}/contact")
    contact.CreatePurposeAttr(UsdGeom.Tokens.guide)
    for solid in content.solids:
        prim, approximation = _add_solid(stage, solid)
        _make_collider(prim, approximation, materials[solid.friction])
    if content.height_field is not None:
        mesh = _add_mesh(stage, f"{ROOT}/contact/height_field", content.height_field.as_mesh())
        _make_collider(mesh.GetPrim(), "none", material)  # its triangles, as they are
    surface = _add_mesh(stage, f"{ROOT}/surface", content.surface)
    colors = find_vertex_colors(content.surface)
    if colors is None:
        surface.CreateDisplayColorAttr([tuple(SURFACE_COLOR[:3])])
    else:
        shares = np.ascontiguousarray(colors / WHITE, dtype=np.float32)
        surface.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(Vt.Vec3fArray.FromNumpy(shares))
    return {"arena.usda": stage.GetRootLayer().ExportToString().encode()}


def _add_material(stage: Any, name: str, friction: float) -> Any:
    from pxr import UsdPhysics, UsdShade

    material = UsdShade.Material.Define(stage, f"{ROOT}/{name}")
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(friction)
    physics.CreateDynamicFrictionAttr(friction)
    physics.CreateRestitutionAttr(0.0)
    return material


def _add_solid(stage: Any, solid: Solid) -> tuple[Any, str | None]:
    """Add a solid as a cube where it is a box, else as a mesh; return its prim and the approximation of a mesh."""
    from pxr import Gf, UsdGeom

    path = f"{ROOT}/contact/{solid.name.removeprefix('arena_')}"
    if solid.box is None:
        return _add_mesh(stage, path, solid.mesh).GetPrim(), "convexHull"
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(2.0)
    cube.CreateExtentAttr([(-1, -1, -1), (1, 1, 1)])
    # Rows, as USD multiplies: the transpose of axes in columns.
    rotation = Gf.Matrix3d(*np.asarray(solid.box.axes, dtype=np.float64).T.ravel().tolist())
    cube.AddTranslateOp().Set(Gf.Vec3d(*solid.box.center.tolist()))
    cube.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(rotation.ExtractRotation().GetQuat())
    cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*solid.box.half_sizes.tolist()))
    return cube.GetPrim(), None


def _add_mesh(stage: Any, path: str, mesh: trimesh.Trimesh) -> Any:
    from pxr import UsdGeom, Vt

    points = np.ascontiguousarray(mesh.vertices, dtype=np.float32)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, dtype=np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    return prim


def _make_collider(prim: Any, approximation: str | None, material: Any) -> None:
    from pxr import UsdPhysics, UsdShade

    UsdPhysics.CollisionAPI.Apply(prim)
    if approximation is not None:
        UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(approximation)
    binding = UsdShade.MaterialBindingAPI.Apply(prim)
    binding.Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")
