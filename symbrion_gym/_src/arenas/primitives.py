"""Primitives of an arena: what stands in for triangles, in rays, in contact and in its folder."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import trimesh
from jaxtyping import Bool

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.halfspaces import Box
from reconstruction._src.surfaces.primitives.find import Primitives, find_primitives
from reconstruction._src.surfaces.primitives.primitive import Primitive
from symbrion_gym._src.contact.distances import SurfaceDistance
from symbrion_gym._src.contact.kinds import Contact
from symbrion_gym._src.errors import ArenaError

_GEOMS = {
    "plane": mujoco.mjtGeom.mjGEOM_BOX,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
}


def add_mesh(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    mesh: trimesh.Trimesh,
    file: str = "",
    **options: Any,
) -> mujoco.MjsGeom:
    """Add a mesh, or the file that holds it, to a body as a geom of its name."""
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    if file:
        spec.add_mesh(name=name, file=file, inertia=shell)
    else:
        vertices = np.asarray(mesh.vertices, dtype=np.float64).ravel()
        faces = np.asarray(mesh.faces, dtype=np.int32).ravel()
        spec.add_mesh(name=name, uservert=vertices, userface=faces, inertia=shell)
    return body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **options)


def add_primitive(
    body: mujoco.MjsBody, name: str, kind: str, shape: Primitive | Box, **options: Any
) -> mujoco.MjsGeom:
    """Add a shape of a kind to a body as a geom."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(shape.axes).ravel())
    place = {"pos": shape.center, "quat": quaternion, "size": shape.half_sizes}
    return body.add_geom(name=name, type=_GEOMS[kind], **place, **options)


def add_mixed_surface(
    spec: mujoco.MjSpec, surface: trimesh.Trimesh, primitives: Primitives, options: dict[str, Any]
) -> None:
    """Add what rays see: primitives, and the triangles that they do not replace as meshes."""
    for i, one in enumerate(primitives.shapes):
        add_primitive(spec.worldbody, f"arena_primitive_{i}", one.kind, one, **options)
    for i, corners in enumerate(_join_small(primitives.find_rest(surface))):
        vertices, index = np.unique(corners.reshape(-1, 3).astype(np.float32), axis=0, return_inverse=True)
        mesh = trimesh.Trimesh(vertices, index.reshape(-1, 3), process=False)
        add_mesh(spec, spec.worldbody, f"arena_surface_{i}", mesh, **options)


def _join_small(parts: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return parts that MuJoCo compiles: those of fewer than two triangles join the next."""
    joined: list[np.ndarray] = []
    for part in sorted(parts, key=len):
        if joined and len(joined[-1]) < 2:
            part = np.concatenate([joined.pop(), part])
        joined.append(part)
    return joined


MOST_COST = 0.67
"""Primitives are used where beams cost at most this share of what they cost on the triangles alone. Time follows the
cost within a third where most beams hit something, as in rooms and on courses; beyond two thirds nothing is sure to be
saved: a table that stands alone costs 0.70 by this measure, and 1.7 in time."""


def compute_beam_cost(surface: trimesh.Trimesh, primitives: Primitives) -> float:
    """Return how many boxes of MuJoCo's trees a random beam through the surface's box enters, in the mean.

    A count, no time: the same on every machine.

    References:
        MacDonald and Booth (1990), Heuristics for ray tracing using space subdivision, The Visual Computer 6, section
        3: a box within another is met with the ratio of their areas.
    """
    spec = mujoco.MjSpec()
    only_seen = {"contype": 0, "conaffinity": 0}  # What is touched needs a hull, which a flat surface has not
    add_mixed_surface(spec, surface, primitives, only_seen)
    model = spec.compile()
    halves = np.concatenate([model.bvh_aabb.reshape(-1, 6)[:, 3:], np.asarray(surface.extents)[None] / 2])
    area = (halves * np.roll(halves, -1, axis=1)).sum(axis=1)
    boxes = [
        area[start : start + n].sum() for start, n in zip(model.mesh_bvhadr, model.mesh_bvhnum, strict=True)
    ]
    return float(sum(boxes) / area[-1])


def pays(surface: trimesh.Trimesh, primitives: Primitives) -> bool:
    """Return whether beams on primitives and the rest cost clearly less than on the triangles alone."""
    if not any(one.kind == "plane" for one in primitives.shapes):
        return True
    none = primitives._replace(shapes=[])
    return compute_beam_cost(surface, primitives) <= MOST_COST * compute_beam_cost(surface, none)


_FAR = 1e6  # Farther out is no arena [m]
_ROTATION = 1e-6  # Largest deviation of axes from a rotation


def find_arena_primitives(surface: trimesh.Trimesh, seed: int) -> Primitives:
    """Return the primitives of an arena's surface; no rectangles where they would not make beams cheaper."""
    try:
        found = find_primitives(surface, seed=seed)
    except ReconstructionError as error:
        raise ArenaError(str(error)) from error
    return found if pays(surface, found) else found._replace(shapes=find_solids(found))


def primitives_to_dict(primitives: Primitives) -> dict[str, Any]:
    """Return primitives for JSON."""
    names = ("center", "axes", "half_sizes")
    rows = [
        {"kind": one.kind} | {name: getattr(one, name).tolist() for name in names}
        for one in primitives.shapes
    ]
    return {"tolerance": primitives.tolerance, "shapes": rows}


def primitives_from_dict(content: dict[str, Any]) -> Primitives:
    """Return what `primitives_to_dict` was made of."""
    try:
        tolerance = float(content["tolerance"])
        shapes = [_read_primitive(row) for row in content["shapes"]]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ArenaError(f"primitives: {error}") from error
    if not 0 < tolerance < _FAR:
        raise ArenaError(f"the tolerance of primitives is {tolerance}; a length above 0 is needed")
    return Primitives(shapes, tolerance)


def _read_primitive(row: dict[str, Any]) -> Primitive:
    kind, center, axes, sizes = (
        row["kind"],
        *(np.array(row[n], float) for n in ("center", "axes", "half_sizes")),
    )
    if kind not in _GEOMS:
        raise ValueError(f"there is no kind {kind!r}; there are: {', '.join(_GEOMS)}")
    if center.shape != (3,) or sizes.shape != (3,) or axes.shape != (3, 3):
        raise ValueError(f"a {kind} needs a center, axes and half sizes of three coordinates")
    count = {"sphere": 1, "cylinder": 2}.get(kind, 3)
    if not (sizes[:count] > 0).all() or not (np.abs([*center, *sizes]) < _FAR).all():
        raise ValueError(f"a {kind} has sizes {sizes} at {center}; lengths above 0 are needed")
    if not np.allclose(axes @ axes.T, np.eye(3), atol=_ROTATION) or np.linalg.det(axes) < 0:
        raise ValueError(f"the axes of a {kind} are {axes.tolist()}; a rotation is needed")
    return Primitive(kind, center, axes, sizes)


def find_solids(primitives: Primitives | None) -> list[Primitive]:
    """Return the boxes, spheres and cylinders: each is a contact piece; they are the last pieces of an arena."""
    return [] if primitives is None else [one for one in primitives.shapes if one.is_solid]


_FEWEST = 4  # Faces of a rest that pieces can be made of


def take_solids_out(surface: trimesh.Trimesh, primitives: Primitives) -> Bool[np.ndarray, " F"]:
    """Return which faces of a surface no solid primitive replaces; none where hardly any would be left."""
    corners = np.asarray(surface.triangles)
    is_left = np.ones(len(corners), dtype=bool)
    for solid in find_solids(primitives):
        is_left &= ~solid.find_replaced(corners, primitives.tolerance)
    return is_left if is_left.sum() >= _FEWEST else np.zeros_like(is_left)


def add_solids_to_contact(
    contact: Contact, mesh: trimesh.Trimesh, primitives: Primitives, has_rest: bool
) -> Contact:
    """Return contact with the solid primitives as its last pieces, and its distances from the whole surface.

    Without a rest of the surface they are all of it.
    """
    solids = [solid.as_mesh() for solid in find_solids(primitives)]
    kinds = [one.kind for one in primitives.shapes]
    notes = {**contact.notes, "primitives": {kind: kinds.count(kind) for kind in sorted(set(kinds))}}
    if not solids:
        return replace(contact, notes=notes)
    pieces = [*contact.pieces, *solids] if has_rest else solids
    quality = SurfaceDistance(mesh).measure(pieces, contact.quality.seconds)
    return replace(contact, pieces=pieces, quality=quality, notes=notes)
