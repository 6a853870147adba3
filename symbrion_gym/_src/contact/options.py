"""What contact geometry is wanted, and everything that tunes how it is made."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree

from reconstruction._src.geometry.mesh_repair import RepairConfig
from reconstruction._src.geometry.outlines import RimConfig
from reconstruction._src.geometry.sampling import sample_area
from symbrion_gym._src.contact.acceptance import AcceptanceConfig
from symbrion_gym._src.contact.boxing import BoxConfig
from symbrion_gym._src.contact.crease_lines import EdgeConfig
from symbrion_gym._src.contact.distances import DistanceConfig, find_nearest
from symbrion_gym._src.contact.kinds import CONTACT_CHOICES, FieldConfig
from symbrion_gym._src.contact.patches import PatchConfig
from symbrion_gym._src.contact.planes import PlaneConfig
from symbrion_gym._src.contact.primitives import PrimitiveConfig, SlabPassConfig
from symbrion_gym._src.contact.seams import SeamConfig
from symbrion_gym._src.contact.simplification import SimplificationConfig, SnapConfig, SubdivisionConfig
from symbrion_gym._src.contact.slab_union import UnionConfig
from symbrion_gym._src.contact.slabs import SlabConfig
from symbrion_gym._src.contact.solid import ShapeConfig, ThicknessConfig
from symbrion_gym._src.errors import ArenaError


@dataclass(frozen=True)
class AccuracyConfig:
    """How the default accuracy follows from a scan.

    Attributes:
        finest: contact need not be closer [m]: a Scout's tracks do not feel 3 mm ...
        extent: ... or this share of the extent of the surface, for small things.
        noise: in standard deviations of the readings from the surface.
        spacing: in median distances of neighboring readings over the surface.
        mesh: without readings, in median lengths of the edges of the surface ...
        coarsest: ... but no more than this many times the finest: a drawn mesh with long edges is exact.
        num_points: readings that are looked at.
    """

    finest: float = 0.003
    extent: float = 1.0 / 500.0
    noise: float = 1.0
    spacing: float = 0.1
    mesh: float = 0.05
    coarsest: float = 2.0
    num_points: int = 5000


ACCURACY_DEFAULTS = AccuracyConfig()
_DEVIATION = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute values."""


def find_accuracy(
    surface: trimesh.Trimesh,
    points: Float[np.ndarray, "N 3"] | None = None,
    config: AccuracyConfig = ACCURACY_DEFAULTS,
) -> float:
    """Return the accuracy that contact geometry of a scanned surface should have [m].

    The median distance of readings from the surface gives their noise; spacing is that of the surface's area, so
    that dense readings near the scanner do not stand for those far from it.
    """
    finest = min(config.finest, config.extent * float(surface.extents.max()))
    if points is None or len(points) < 2:
        edges = config.mesh * float(np.median(surface.edges_unique_length))
        return min(max(finest, edges), config.coarsest * finest)
    rng = np.random.default_rng(0)
    chosen = np.sort(rng.permutation(len(points))[: config.num_points])
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    residual, _, _ = find_nearest(points[chosen], vertices, faces)
    noise = _DEVIATION * float(np.median(residual))
    samples = sample_area(vertices, faces, config.num_points)
    tree = cKDTree(points)
    _, nearest = tree.query(samples)
    distance, _ = tree.query(points[nearest], k=2)
    spacing = float(np.median(distance[:, 1]))
    return max(finest, config.noise * noise, config.spacing * spacing)


@dataclass(frozen=True)
class SearchConfig:
    """How coacd decomposes a solid.

    coacd's own defaults take five times as long on a scanned body and give no fewer pieces, and no closer ones.

    Attributes:
        thresholds: concavities left, relative to half the longest extent, tried from coarse to fine.
        iterations: number of iterations of its tree search.
        depth: depth of that tree.
        nodes: children of a node.
        resolution: points on which a cut is rated.
        max_faces: larger solids are simplified first: its time grows faster than the number of faces.
    """

    thresholds: tuple[float, ...] = (0.05, 0.02)
    iterations: int = 60
    depth: int = 2
    nodes: int = 10
    resolution: int = 1000
    max_faces: int = 1000


@dataclass(frozen=True)
class ContactConfig:
    """What tunes each pass from a surface to contact geometry; the defaults suit scans of places for robots.

    Attributes:
        repair: what of a mesh is kept.
        accuracy: how the default accuracy follows from the scan.
        acceptance: what is good enough, and which candidate takes the place of the best so far.
        distance: how distances are measured.
        shapes: what counts as a terrain.
        subdivision: which meshes are cut finer.
        planes: how planes are found.
        snapping: how vertices are moved onto planes.
        simplification: how far a surface is simplified.
        patches: how triangles are joined to convex patches.
        joining: triangles are joined within this share of what patches aim at.
        aim: patches aim at this share of the accuracy while they are few enough: beams that graze a wall feel a few
            millimeters.
        thickness: how thick the solid behind a patch is.
        slab_pass: which terrains become slabs.
        slabs: how a terrain is cut into slabs.
        seams: how seams are closed.
        boxes: how pieces are turned into boxes.
        edges: how far hidden ends of pieces stop short of crests.
        primitives: which planes become boxes, for the kind "primitives".
        heights: which terrains become height fields.
        union: how slabs are united for coacd.
        search: how coacd decomposes a solid.
    """

    repair: RepairConfig = field(default_factory=lambda: RepairConfig(rims=RimConfig()))
    accuracy: AccuracyConfig = field(default_factory=AccuracyConfig)
    acceptance: AcceptanceConfig = field(default_factory=AcceptanceConfig)
    distance: DistanceConfig = field(default_factory=DistanceConfig)
    shapes: ShapeConfig = field(default_factory=ShapeConfig)
    subdivision: SubdivisionConfig = field(default_factory=SubdivisionConfig)
    planes: PlaneConfig = field(default_factory=PlaneConfig)
    snapping: SnapConfig = field(default_factory=SnapConfig)
    simplification: SimplificationConfig = field(default_factory=SimplificationConfig)
    patches: PatchConfig = field(default_factory=PatchConfig)
    joining: float = 0.8
    aim: float = 0.4
    thickness: ThicknessConfig = field(default_factory=ThicknessConfig)
    slab_pass: SlabPassConfig = field(default_factory=SlabPassConfig)
    slabs: SlabConfig = field(default_factory=SlabConfig)
    seams: SeamConfig = field(default_factory=SeamConfig)
    boxes: BoxConfig = field(default_factory=BoxConfig)
    edges: EdgeConfig = field(default_factory=EdgeConfig)
    primitives: PrimitiveConfig = field(default_factory=PrimitiveConfig)
    heights: FieldConfig = field(default_factory=FieldConfig)
    union: UnionConfig = field(default_factory=UnionConfig)
    search: SearchConfig = field(default_factory=SearchConfig)


@dataclass(frozen=True)
class ContactOptions:
    """What contact geometry is wanted.

    Attributes:
        accuracy: mean distance between contact and surface that is good enough [m]; None: as fine as the scan.
        max_pieces: no more convex pieces than these.
        kind: one of `CONTACT_CHOICES`.
        thickness: how far slabs reach below the lowest ground [m].
        seed: seed of coacd's search.
        time_limit: emergency stop: building ends then with the best so far [s].
        config: everything else.

    Raises:
        ArenaError: an option is out of range.
    """

    accuracy: float | None = None
    max_pieces: int = 2200
    kind: str = "auto"
    thickness: float = 0.2
    seed: int = 0
    time_limit: float = 300.0
    config: ContactConfig = field(default_factory=ContactConfig)

    def __post_init__(self) -> None:
        if self.kind not in CONTACT_CHOICES:
            raise ArenaError(
                f"unknown kind of contact {self.kind!r}; there are: {', '.join(CONTACT_CHOICES)}"
            )
        for name in ("accuracy", "thickness", "time_limit"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise ArenaError(f"{name} must be above 0, got {value}")
        if self.max_pieces < 1:
            raise ArenaError(f"max_pieces must be 1 or more, got {self.max_pieces}")

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON; `config` only where it is not the default."""
        fields = asdict(self)
        return (
            fields if self.config != ContactConfig() else {k: v for k, v in fields.items() if k != "config"}
        )
