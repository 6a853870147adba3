"""Slivers at the rim of an open surface, which a Delaunay triangulation adds between far readings, removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.errors import ReconstructionError


@dataclass(frozen=True)
class RimConfig:
    """What at the rim of a surface is a sliver.

    Attributes:
        longest: its edge at the rim is longer than this many median edges of the surface: a network leaves none ...
        min_angle_deg: ... and its corner off the rim has an angle above this [degrees]: it is low ...
        min_bend_deg: ... and it is bent against its neighbors by more than this [degrees]: a low triangle of flat
            ground is part of the ground.
        rounds: slivers behind slivers are removed, too, in no more rounds than these.

    Raises:
        ReconstructionError: a value is out of range.
    """

    longest: float = 5.0
    min_angle_deg: float = 120.0
    min_bend_deg: float = 10.0
    rounds: int = 20

    def __post_init__(self) -> None:
        if not self.longest >= 1.0:
            raise ReconstructionError(
                f"longest must be 1 or more, got {self.longest}: half of all edges are longer"
            )
        if not 60.0 <= self.min_angle_deg < 180.0:
            raise ReconstructionError(
                f"min_angle_deg must be from 60 to 180, got {self.min_angle_deg}: "
                "the angle opposite of a longest edge is"
            )


RIM_DEFAULTS = RimConfig()


def drop_rim_slivers(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], config: RimConfig = RIM_DEFAULTS
) -> Int[np.ndarray, "G 3"]:
    """Return the faces without slivers at the rim, which bridge ground that no vertex stands for."""
    lengths = _find_lengths(vertices, faces)
    longest = config.longest * float(np.median(lengths)) if len(faces) else 0.0
    for _ in range(config.rounds):
        is_sliver = _find_slivers(vertices, faces, longest, config)
        if not is_sliver.any() or is_sliver.all():
            break
        faces = faces[~is_sliver]
    return faces


def _find_lengths(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "F 3"]:
    """Return the length of the edge opposite of every corner [m]."""
    corners = vertices[faces]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)


def _find_slivers(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], longest: float, config: RimConfig
) -> Bool[np.ndarray, " F"]:
    lengths = _find_lengths(vertices, faces)
    rows, corner = np.arange(len(faces)), lengths.argmax(axis=1)
    long = lengths[rows, corner]
    others = np.sort(lengths, axis=1)[:, :2]
    # Law of cosines at the corner opposite of the longest edge.
    cosine = (others[:, 0] ** 2 + others[:, 1] ** 2 - long**2) / (2.0 * others[:, 0] * others[:, 1])
    is_low = (long > longest) & (cosine < np.cos(np.radians(config.min_angle_deg)))
    if not is_low.any():
        return is_low
    ends = np.sort(np.stack([faces[rows, corner - 2], faces[rows, corner - 1]], axis=1), axis=1)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    rim = {(int(a), int(b)) for a, b in unique[count == 1]}
    is_rim = np.array([pair in rim for pair in map(tuple, ends.tolist())], dtype=bool)
    return is_low & is_rim & (_find_bends(vertices, faces) > np.radians(config.min_bend_deg))


def _find_bends(vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> Float[np.ndarray, " F"]:
    """Return the largest angle of each face with a neighbor [rad]."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    angles = np.asarray(mesh.face_adjacency_angles)
    bends = np.zeros(len(faces))
    np.maximum.at(bends, pairs.ravel(), np.repeat(angles, 2))
    return bends
