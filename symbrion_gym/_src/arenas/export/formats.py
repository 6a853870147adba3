"""What an export consists of, and its formats, each a function that returns its files: MJCF, URDF, USD and OBJ."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float, Int, Num
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from reconstruction._src.base.extras import require_extras
from reconstruction._src.geometry.rows import make_hull
from reconstruction._src.surfaces.color import WHITE, find_vertex_colors
from symbrion_gym._src.arenas.friction_map import cut_solid
from symbrion_gym._src.arenas.placed_objects import add_objects
from symbrion_gym._src.arenas.primitives import add_mesh
from symbrion_gym._src.arenas.spec import (
    SURFACE_COLOR,
    SURFACE_LOOK,
    ArenaGeometry,
    Solid,
    add_height_field,
    add_solids,
    make_solids,
)
from symbrion_gym._src.arenas.surface_file import format_obj
from symbrion_gym._src.arenas.texture import TEXTURE_FILE, add_texture, to_png
from symbrion_gym._src.errors import ArenaError

FEWEST_VERTICES = 8
"""The least limit: that of a box. With fewer, most solids would become hundreds of tetrahedra."""
_TOLERANCE = 2e-4
"""How far the dropped vertices of a solid may stick out [m]: below the noise of any scanner. With more, fewer solids
are cut, and the contact moves further from what was measured."""
_MOST_CUTS = 6
"""How often a solid is halved; what then still has too many vertices is approximated from inside."""


def limit_vertices(
    solid: trimesh.Trimesh, most: int, cuts_left: int = _MOST_CUTS
) -> tuple[list[trimesh.Trimesh], float]:
    """Return convex solids of at most some vertices in place of one, and how far that sticks out of them [m]."""
    if len(solid.vertices) <= most:
        return [solid], 0.0
    hull = make_hull(np.asarray(solid.vertices, dtype=np.float64))
    if hull is None:  # thinner than rounding
        return [], 0.0
    corners = np.asarray(hull.vertices)
    if len(corners) <= most:
        return [hull], 0.0
    chosen, deviation = _choose_corners(corners, most)
    reduced = make_hull(corners[chosen])
    if reduced is not None and (deviation <= _TOLERANCE or cuts_left == 0):
        return [reduced], deviation
    axis = int(np.ptp(corners, axis=0).argmax())
    along = corners[:, axis]
    place = float(np.clip(np.median(along), *np.quantile([along.min(), along.max()], [0.25, 0.75])))
    halves = [half for half in cut_solid(hull, np.eye(3)[axis], place) if half is not None]
    limited = [limit_vertices(half, most, max(cuts_left - 1, 0)) for half in halves]
    return [part for parts, _ in limited for part in parts], max(each for _, each in limited)


def _choose_corners(corners: Float[np.ndarray, "N 3"], most: int) -> tuple[Int[np.ndarray, " M"], float]:
    """Choose corners greedily, always the one farthest outside of the hull of those chosen before."""
    chosen = list(dict.fromkeys(int(index) for axis in corners.T for index in (axis.argmin(), axis.argmax())))
    for index in range(len(corners)):  # more corners where these lie in a plane
        if len(chosen) >= 4 and np.linalg.matrix_rank(corners[chosen] - corners[chosen[0]]) == 3:
            break
        if index not in chosen:
            chosen.append(index)
    outside = np.full(len(corners), np.inf)
    while len(chosen) <= most:
        try:
            planes = ConvexHull(corners[chosen]).equations
        except QhullError:
            break
        outside = (corners @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        farthest = int(outside.argmax())
        if len(chosen) == most or outside[farthest] <= 0.0 or farthest in chosen:
            break
        chosen.append(farthest)
    return np.array(chosen[:most]), max(float(outside.max()), 0.0)


class Content(NamedTuple):
    """An arena as the writers of the formats see it."""

    geometry: ArenaGeometry  # its pieces are the solids before any was cut
    solids: list[Solid]  # convex solids, for contact
    deviation: float  # how far an original piece sticks out of the solids, at most [m]


def make_content(geometry: ArenaGeometry, max_vertices: int | None) -> Content:
    """Return the content of an export, its solids of at most so many vertices, or without a limit."""
    if max_vertices is None:
        parts, deviation = list(geometry.pieces), 0.0
    elif max_vertices < FEWEST_VERTICES:
        raise ArenaError(
            f"max_vertices is {max_vertices}; {FEWEST_VERTICES} or more are needed, or None for no limit"
        )
    else:
        limited = [limit_vertices(piece, max_vertices) for piece in geometry.pieces]
        parts = [part for pieces, _ in limited for part in pieces]
        deviation = max((each for _, each in limited), default=0.0)
    digits = max(len(str(len(parts) - 1)), 3)
    return Content(geometry, make_solids(geometry._replace(pieces=parts), digits), deviation)


_BODY = "arena"  # Name of the body that holds all geoms
_DIGITS = 6  # Coordinates to 1 µm, as in a saved arena


def format_mjcf(content: Content) -> dict[str, bytes]:
    """Return `arena.xml` with contact and surface, and `contact.xml` without the surface.

    The vertices stand in the files: no path breaks when another model includes one, and 2,000 pieces load faster than
    from 2,000 files.
    """
    texture = content.geometry.texture
    pictures = {} if texture is None else {TEXTURE_FILE: to_png(texture.image)}
    models = {"arena.xml": _format_model(content, pictures), "contact.xml": _format_model(content, None)}
    return models | pictures


def _format_model(content: Content, pictures: dict[str, bytes] | None) -> bytes:
    """Return a model with the surface and its pictures, or with contact alone."""
    geometry, exact = content.geometry, {}
    spec = mujoco.MjSpec()
    spec.modelname = f"arena {content.geometry.name}"
    body = spec.worldbody.add_body(name=_BODY)
    add_solids(spec, body, content.solids, content.geometry.friction)
    if geometry.height_field is not None:
        add_height_field(spec, body, geometry.height_field, content.geometry.friction)
    if pictures is not None:
        surface = geometry.surface
        if geometry.texture is not None:  # faces have vertices of their own, as MJCF has texture coordinates
            corners = np.asarray(surface.triangles).reshape(-1, 3)
            surface = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
        exact["arena_surface"] = surface.vertices
        geom = add_mesh(spec, body, "arena_surface", surface, **SURFACE_LOOK)
        if geometry.texture is not None:
            add_texture(spec, geom, geometry.texture, use_files=True)
            places = np.array([0.0, 1.0]) + np.array([1.0, -1.0]) * geometry.texture.uv
            spec.mesh("arena_surface").usertexcoord = places.ravel()
        add_objects(spec, content.geometry.objects, body)
        spec.assets = pictures
    for geom in spec.geoms:
        geom.mass = 0.0
    spec.compile()
    root = ElementTree.fromstring(spec.to_xml())
    for compiler in root.findall("compiler"):  # a model that includes this one has its own unit of angles
        root.remove(compiler)
    exact |= {solid.name: solid.mesh.vertices for solid in content.solids}
    centers = {solid.name: solid.box.center for solid in content.solids if solid.box is not None}
    for mesh in root.iter("mesh"):
        if mesh.get("name") in exact:
            mesh.set("vertex", _join(exact[mesh.get("name")]))
    for geom in root.iter("geom"):
        name = geom.get("name")
        if name in centers:
            geom.set("pos", _join(centers[name]))
        elif name in exact:  # in the frame of the body, but for rounding
            for attribute in ("pos", "quat"):
                geom.attrib.pop(attribute, None)
    ElementTree.indent(root)
    return ElementTree.tostring(root) + b"\n"


def _join(values: Num[np.ndarray, " ..."]) -> str:
    """Return numbers as text: MuJoCo writes six digits, which are millimeters in a place of a kilometer."""
    rounded = np.round(np.asarray(values, dtype=np.float64), _DIGITS) + 0.0
    return " ".join(map(str, rounded.ravel().tolist()))


def format_obj_files(content: Content) -> dict[str, bytes]:
    """Return `contact.obj`, one object a piece, and `surface.obj`."""
    named = [(solid.name, solid.mesh) for solid in content.solids]
    if content.geometry.height_field is not None:
        named.append(("arena_height_field", content.geometry.height_field.as_mesh()))
    parts, used = [], 0
    for name, mesh in named:
        parts.append(f"o {name}\n".encode() + format_obj(mesh, used=used))
        used += len(mesh.vertices)
    return {"contact.obj": b"".join(parts), **_format_surface(content)}


def _format_surface(content: Content) -> dict[str, bytes]:
    """Return `surface.obj`; of a colored surface with its vertex colors, and its texture and material as files."""
    surface, texture = content.geometry.surface, content.geometry.texture
    if texture is None:
        return {"surface.obj": format_obj(surface)}
    return {
        "surface.obj": b"mtllib surface.mtl\nusemtl surface\n" + format_obj(surface, texture),
        "surface.mtl": f"newmtl surface\nKa 1 1 1\nKd 1 1 1\nmap_Kd {TEXTURE_FILE}\n".encode(),
        TEXTURE_FILE: to_png(texture.image),
    }


def format_urdf(content: Content) -> dict[str, bytes]:
    """Return `arena.urdf`, and the meshes that it names by paths relative to it.

    One link without inertia, thus static, with a collision element a piece and the surface as its visual. URDF knows no
    vertices in the file and no two hulls in one mesh file, so each piece that is no box has a file.
    """
    if content.geometry.height_field is not None:
        raise ArenaError(
            f"arena {content.geometry.name!r} is a height field, which URDF does not have; "
            "export it to mjcf, usd or obj, or make it again of the kind 'convex'"
        )
    add, friction = ElementTree.SubElement, f"{content.geometry.friction:g}"
    files, robot = (
        _format_surface(content),
        ElementTree.Element("robot", name=f"arena {content.geometry.name}"),
    )
    # For MuJoCo, whose importer else looks for meshes without their folder and leaves visuals out.
    add(add(robot, "mujoco"), "compiler", strippath="false", discardvisual="false")
    link = add(robot, "link", name=_BODY)
    add(add(link, "contact"), "lateral_friction", value=friction)  # for PyBullet; URDF itself has no friction
    visual = add(link, "visual", name="arena_surface")
    add(add(visual, "geometry"), "mesh", filename="surface.obj")
    for solid in content.solids:
        collision = add(link, "collision", name=solid.name)
        if solid.box is None:
            file = f"pieces/{solid.name.removeprefix('arena_piece_')}.obj"
            files[file] = format_obj(solid.mesh)
            add(add(collision, "geometry"), "mesh", filename=file)
        else:
            # Roll, pitch and yaw: about the fixed x, then y, then z [rad].
            angles = Rotation.from_matrix(solid.box.axes).as_euler("xyz", suppress_warnings=True)
            rpy = " ".join(f"{angle:.9f}" for angle in angles)
            add(collision, "origin", xyz=_join(solid.box.center), rpy=rpy)
            add(add(collision, "geometry"), "box", size=_join(2 * np.asarray(solid.box.half_sizes)))
    gazebo = add(robot, "gazebo", reference=_BODY)
    for name in ("mu1", "mu2"):
        add(gazebo, name).text = friction
    ElementTree.indent(robot)
    return {"arena.urdf": b'<?xml version="1.0"?>\n' + ElementTree.tostring(robot) + b"\n", **files}


_ROOT = "/arena"  # Path of the default prim, which holds everything


def format_usd(content: Content) -> dict[str, bytes]:
    """Return `arena.usda` with the physics schema, for every reader of UsdPhysics.

    Colliders without a rigid body are static. Pieces have the purpose "guide": renderers show the surface alone.
    """
    require_extras("export to usd", "usd")
    from pxr import Usd, UsdGeom, Vt

    geometry = content.geometry
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, _ROOT).GetPrim())
    ground = _add_material(stage, "ground", content.geometry.friction)
    frictions = dict.fromkeys(solid.friction for solid in content.solids if solid.friction is not None)
    patches = {each: _add_material(stage, f"patch_{i}", each) for i, each in enumerate(frictions)}
    contact = UsdGeom.Xform.Define(stage, f"{_ROOT}/contact")
    contact.CreatePurposeAttr(UsdGeom.Tokens.guide)
    for solid in content.solids:
        prim, approximation = _add_solid(stage, solid)
        _make_collider(prim, approximation, ground if solid.friction is None else patches[solid.friction])
    if geometry.height_field is not None:
        mesh = _add_mesh(stage, f"{_ROOT}/contact/height_field", geometry.height_field.as_mesh())
        _make_collider(mesh.GetPrim(), "none", ground)  # its triangles, as they are
    surface = _add_mesh(stage, f"{_ROOT}/surface", geometry.surface)
    colors = find_vertex_colors(geometry.surface)
    if colors is None:
        surface.CreateDisplayColorAttr([tuple(SURFACE_COLOR[:3])])
    else:
        shares = np.ascontiguousarray(colors / WHITE, dtype=np.float32)
        surface.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(Vt.Vec3fArray.FromNumpy(shares))
    return {"arena.usda": stage.GetRootLayer().ExportToString().encode()}


def _add_material(stage: Any, name: str, friction: float) -> Any:
    from pxr import UsdPhysics, UsdShade

    material = UsdShade.Material.Define(stage, f"{_ROOT}/{name}")
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(friction)
    physics.CreateDynamicFrictionAttr(friction)
    physics.CreateRestitutionAttr(0.0)
    return material


def _add_solid(stage: Any, solid: Solid) -> tuple[Any, str | None]:
    """Add a solid as a cube where it is a box, else as a mesh; return its prim and the approximation of a mesh."""
    from pxr import Gf, UsdGeom

    path = f"{_ROOT}/contact/{solid.name.removeprefix('arena_')}"
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


FORMATS: dict[str, Callable[[Content], dict[str, bytes]]] = {
    "mjcf": format_mjcf,
    "urdf": format_urdf,
    "usd": format_usd,
    "obj": format_obj_files,
}
"""Format -> the function that returns its files: name -> content."""
