"""Known objects in an arena: their poses and shapes; sites that tasks can use, geoms that are drawn."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float

from symbrion_gym._src.arenas.primitives import add_mesh
from symbrion_gym._src.errors import ArenaError

OBJECT_GROUP = 1
"""Geom group of known objects: drawn; touched by nothing and seen by no sensor, as the scanned surface has them."""
OBJECT_COLOR = (0.16, 0.45, 0.80, 1.0)
MAX_OBJECTS = 1000
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")
_ROUNDING = 1e-5  # A rotation deviates from an orthonormal matrix by less


@dataclass(frozen=True, eq=False)
class PlacedObject:
    """A known object at its place.

    Raises:
        ArenaError: the name, the position, the rotation or the mesh cannot be used.
    """

    name: str  # what kind of object it is: letters, digits, `_` and `-`
    position: Float[np.ndarray, " 3"]  # of the origin of its mesh, in the arena's frame [m]
    rotation: Float[np.ndarray, "3 3"]  # mesh to arena; x points to the front of the object
    mesh: trimesh.Trimesh  # its shape, in its own frame [m]

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not _NAME.fullmatch(self.name):
            raise ArenaError(
                f"object name is {self.name!r}; letters, digits, _ and - are possible, 60 at most"
            )
        for field, shape in (("position", (3,)), ("rotation", (3, 3))):
            try:
                value = np.array(getattr(self, field), dtype=np.float64)
            except (TypeError, ValueError):
                value = np.zeros(0)
            if value.shape != shape or not np.isfinite(value).all():
                raise ArenaError(f"object {self.name!r}: {field} must be {shape} finite numbers")
            object.__setattr__(self, field, value)
        turned = self.rotation @ self.rotation.T
        if np.abs(turned - np.eye(3)).max() > _ROUNDING or np.linalg.det(self.rotation) < 0:
            raise ArenaError(f"object {self.name!r}: rotation must be a rotation matrix")
        if not len(self.mesh.faces) or not np.isfinite(self.mesh.vertices).all():
            raise ArenaError(f"object {self.name!r}: the mesh has no faces, or vertices that are not finite")

    @property
    def front(self) -> Float[np.ndarray, " 2"]:
        """Direction (x, y) in which its front points, of length 1; of one that looks up or down, x of the arena."""
        ahead = self.rotation[:2, 0]
        length = float(np.linalg.norm(ahead))
        return ahead / length if length > 1e-6 else np.array([1.0, 0.0])

    @property
    def reach(self) -> float:
        """How far it sticks out to its front from its origin [m]."""
        return float(np.asarray(self.mesh.vertices)[:, 0].max())

    def as_dict(self) -> dict[str, Any]:
        """Return JSON content that `read_objects` takes."""
        return {
            "name": self.name,
            "position": self.position.tolist(),
            "rotation": self.rotation.tolist(),
            "vertices": np.round(np.asarray(self.mesh.vertices, np.float64), 6).tolist(),
            "faces": np.asarray(self.mesh.faces).tolist(),
        }


def check_objects(objects: Any) -> tuple[PlacedObject, ...]:
    """Return the objects of an arena."""
    objects = tuple(objects)
    if len(objects) > MAX_OBJECTS:
        raise ArenaError(f"there are {len(objects)} objects; {MAX_OBJECTS} are possible")
    for each in objects:
        if not isinstance(each, PlacedObject):
            raise ArenaError(f"objects must be PlacedObjects, got {type(each).__name__}")
    return objects


def name_objects(objects: Iterable[PlacedObject]) -> dict[str, PlacedObject]:
    """Return the objects by the names of their sites: `object_<name>_<i>`, counted for each name."""
    counts: dict[str, int] = {}
    named: dict[str, PlacedObject] = {}
    for each in objects:
        number = counts.get(each.name, 0)
        counts[each.name] = number + 1
        named[f"object_{each.name}_{number}"] = each
    return named


def find_object(objects: Iterable[PlacedObject], name: str) -> PlacedObject:
    """Return the object with a site's name, or the only one of a kind."""
    objects = tuple(objects)
    named = name_objects(objects)
    if name in named:
        return named[name]
    alike = [each for each in objects if each.name == name]
    if len(alike) == 1:
        return alike[0]
    known = ", ".join(named) or "none; find them with `symbrion arena MESH --scan SCAN --object FILE`"
    raise ArenaError(f"{len(alike) or 'no'} objects {name!r} in the arena; there are: {known}")


def add_objects(
    spec: mujoco.MjSpec, objects: Iterable[PlacedObject], body: mujoco.MjsBody | None = None
) -> None:
    """Add a site and a geom of each object to a body, or to the world; the geom touches nothing."""
    look = {"contype": 0, "conaffinity": 0, "group": OBJECT_GROUP, "rgba": OBJECT_COLOR}
    for name, each in name_objects(objects).items():
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, each.rotation.ravel())
        place = {"pos": each.position, "quat": quaternion}
        add_mesh(spec, body or spec.worldbody, name, each.mesh, **place, **look)
        (body or spec.worldbody).add_site(name=name, **place, size=[0.01, 0.01, 0.01])


def describe_objects(objects: Iterable[PlacedObject]) -> dict[str, Any]:
    """Return `objects.json` of an export: name of the site -> kind, position [m] and rotation."""
    keys = ("name", "position", "rotation")
    return {name: {key: each.as_dict()[key] for key in keys} for name, each in name_objects(objects).items()}


def read_objects(content: Any) -> tuple[PlacedObject, ...]:
    """Return the objects that `as_dict` described."""
    objects = []
    for number, each in enumerate(content):
        try:
            vertices = np.array(each["vertices"], dtype=np.float64).reshape(-1, 3)
            faces = np.array(each["faces"], dtype=np.int64).reshape(-1, 3)
            if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
                raise ValueError("a face names a vertex that there is not")
            mesh = trimesh.Trimesh(vertices, faces, process=False)
            objects.append(PlacedObject(each["name"], each["position"], each["rotation"], mesh))
        except (KeyError, TypeError, ValueError) as error:
            raise ArenaError(f"objects[{number}]: {error}") from error
    return check_objects(objects)
