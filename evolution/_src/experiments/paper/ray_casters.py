"""Methods of casting a laser scan: MuJoCo's tree on the exact surface or contact shapes, Embree, brute force."""

import copy
import dataclasses
from typing import Any, Protocol

import numpy as np
import trimesh
from jaxtyping import Float

import symbrion_gym as sg
from symbrion_gym._src.arenas.spec import CONTACT_GROUP, SURFACE_GROUP
from symbrion_gym._src.sensing.laser_scanner import LaserScanner

SITE = "module_0"
_CHUNK = 2_000_000
"""Pairs of ray and triangle that are tested at once; more would not fit into the cache of a large processor."""


class Caster(Protocol):
    """Casts one scan."""

    def __call__(self, pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " beams"]:
        """Return the ranges of a scan from a pose [m], nan where nothing is in range."""
        ...


class TreeCaster:
    """A scan by `mj_multiRay`, through bounding-volume trees.

    Args:
        arena: the scanned arena.
        on_contact: scan the contact shapes instead of the exact surface.
    """

    def __init__(self, arena: sg.Arena, on_contact: bool = False) -> None:
        environment = sg.SnakePitEnv(arena=arena, modules=1)
        environment.reset(seed=0)
        model = environment.model
        if on_contact:
            model = copy.copy(model)
            is_contact = (model.geom_group == CONTACT_GROUP) & (model.geom_bodyid == 0)
            model.geom_group[model.geom_group == SURFACE_GROUP] = CONTACT_GROUP
            model.geom_group[is_contact] = SURFACE_GROUP
            model.geom_rgba[is_contact, 3] = 1.0  # rays pass through transparent geoms
        self._data = environment.data
        self._site = model.site(SITE).id
        self._finder = sg.RangeFinder(model, SITE, groups=(SURFACE_GROUP,))

    def __call__(self, pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " beams"]:
        self._data.site_xpos[self._site] = pose[:3, 3]
        self._data.site_xmat[self._site] = pose[:3, :3].ravel()
        return self._finder.read(self._data)


class EmbreeCaster:
    """A scan by Embree, in single precision.

    Args:
        mesh: the surface.

    Raises:
        ImportError: `embreex` is not installed.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene: Any = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, np.asarray(mesh.triangles, dtype=np.float32))
        self._scanner = LaserScanner()

    def __call__(self, pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " beams"]:
        directions = (self._scanner.directions @ pose[:3, :3].T).astype(np.float32)
        origins = np.tile(pose[:3, 3].astype(np.float32), (len(directions), 1))
        ranges = self._scene.run(origins, directions, query="DISTANCE").astype(np.float64)
        return np.where(ranges <= self._scanner.max_range, ranges, np.nan)


class BruteForceCaster:
    """A scan that tests every triangle with every beam, like a simulator without bounding volumes.

    Args:
        mesh: the surface.

    References:
        Möller and Trumbore (1997), Fast, minimum storage ray-triangle intersection.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        corners = np.asarray(mesh.triangles, dtype=np.float64)
        self._corner = corners[:, 0]
        self._edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        self._scanner = LaserScanner()

    def __call__(self, pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " beams"]:
        directions = self._scanner.directions @ pose[:3, :3].T
        nearest = np.full(len(directions), np.inf)
        rows = max(1, _CHUNK // len(directions))
        for start in range(0, len(self._corner), rows):
            part = slice(start, start + rows)
            found = _intersect(pose[:3, 3], directions, self._corner[part], *(e[part] for e in self._edges))
            np.minimum(nearest, found, out=nearest)
        return np.where(nearest <= self._scanner.max_range, nearest, np.nan)


def _intersect(
    origin: Float[np.ndarray, " 3"],
    directions: Float[np.ndarray, "beams 3"],
    corner: Float[np.ndarray, "F 3"],
    edge: Float[np.ndarray, "F 3"],
    other: Float[np.ndarray, "F 3"],
) -> Float[np.ndarray, " beams"]:
    """Return the distance of the nearest triangle along every ray [m], inf where none is hit.

    With one origin for all rays the triple products become matrix products: with s = origin - corner,
    det = -d . (e1 x e2), u det = -d . (s x e2), v det = -d . (e1 x s), t det = s . (e1 x e2).
    """
    reach = origin - corner
    normal = np.cross(edge, other)
    det = -directions @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        u = -(directions @ np.cross(reach, other).T) / det
        v = -(directions @ np.cross(edge, reach).T) / det
        t = np.sum(reach * normal, axis=1) / det
        t[~((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0))] = np.inf
    return t.min(axis=1, initial=np.inf)


def show_surface(mesh: trimesh.Trimesh) -> sg.Arena:
    """Return the hand-made arena with another exact surface for rays."""
    return dataclasses.replace(sg.load_arena("simple"), surface=mesh)
