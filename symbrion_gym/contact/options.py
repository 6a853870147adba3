"""What contact geometry is wanted, and everything that tunes how it is made."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from reconstruction.geometry.mesh_repair import RepairConfig
from symbrion_gym.contact.boxing import BoxConfig
from symbrion_gym.contact.kinds import CONTACT_KINDS
from symbrion_gym.contact.planes import PlaneConfig
from symbrion_gym.contact.primitives import PrimitiveConfig
from symbrion_gym.contact.seams import SeamConfig
from symbrion_gym.contact.slab_fit import SlabFitConfig
from symbrion_gym.contact.slab_union import UnionConfig
from symbrion_gym.contact.slabs import SlabConfig
from symbrion_gym.contact.solid import ShapeConfig
from symbrion_gym.contact.subdivision import SubdivisionConfig
from symbrion_gym.errors import ArenaError


@dataclass(frozen=True)
class SearchConfig:
    """How coacd decomposes a body.

    coacd's own defaults take five times as long on a scanned body and give no fewer pieces, and no closer ones.

    Attributes:
        thresholds: concavities left, relative to half the longest extent, tried from coarse to fine.
        last_threshold: tried on a simplified, remeshed body where the others failed.
        iterations: number of iterations of its tree search.
        depth: depth of that tree.
        nodes: children of a node.
        resolution: points on which a cut is rated.
        remeshing: resolution of its remeshing, where that is needed.
        max_faces: larger bodies are simplified first: its time grows faster than the number of faces.
        last_faces: share of them for the last attempt.
        share: processor time for one attempt, of the time limit; what is left is for another one.
        least_time: for one attempt, by the clock [s].
        finer_until: no finer threshold is tried once this share of the time limit is used up ...
        fewer_until: ... and none of too many pieces again for fewer ones.
        max_thickness: a surface is thickened by no more than this share of its extent: small things stay hollow.
    """

    thresholds: tuple[float, ...] = (0.05, 0.02, 0.01)
    last_threshold: float = 0.1
    iterations: int = 60
    depth: int = 2
    nodes: int = 10
    resolution: int = 1000
    remeshing: int = 30
    max_faces: int = 4000
    last_faces: float = 0.25
    share: float = 0.4
    least_time: float = 1.0
    finer_until: float = 0.25
    fewer_until: float = 0.5
    max_thickness: float = 0.1


@dataclass(frozen=True)
class SelectionConfig:
    """Which contact geometry of a terrain is taken, and when work on it ends.

    Attributes:
        scales: planes are looked for within these multiples of the accuracy, until few enough are found.
        planes_share: few enough are this share of the pieces that are wanted ...
        min_planes: ... or this number in any case ...
        similar_planes: ... or no more than this many times those at the coarsest scale.
        noise_accuracy: slabs are good enough within this many standard deviations of the noise.
        fitted_accuracy: fitted slabs are good enough within this many times the accuracy.
        max_slabs: more slabs never go to coacd: its time grows faster, and of rough ground it gives many more pieces.
        coacd_share: coacd may use this share of the time limit, as processor time, for united slabs ...
        coacd_clock: ... and this share of what is left by the clock.
        as_close: coacd's pieces are as good as the slabs if the mean and the 95th percentile of their distance from
            the surface are larger by no more than this share of the accuracy ...
        as_wide: ... and if no more than this share of the ground has no piece beneath it that had a slab.
        as_little: what is no more than this many times the slabs' own is as good in any case.
        more_pieces: coacd may give this many times as many pieces as there are slabs, or `more_few` more.
        more_few: see `more_pieces`.
        max_finished: more pieces are left as they are: mending compares every piece with all others.
        max_parts: pieces are not cut at creases into more parts than these.
        boxes_off: what boxes may add to the mean distance; twice as much to its 95th percentile [m].
        boxes_uncovered: what boxes may add to the share of the ground without contact.
        time: shares of the time limit at which finding planes, cutting slabs, mending them, fitting caps, mending
            coacd's pieces and turning into boxes end.
    """

    scales: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0)
    planes_share: float = 0.5
    min_planes: int = 8
    similar_planes: float = 1.25
    noise_accuracy: float = 1.5
    fitted_accuracy: float = 3.0
    max_slabs: int = 24
    coacd_share: float = 0.5
    coacd_clock: float = 0.8
    as_close: float = 0.1
    as_wide: float = 1e-4
    as_little: float = 1.1
    more_pieces: float = 1.5
    more_few: int = 3
    max_finished: int = 24
    max_parts: int = 16
    boxes_off: float = 3e-4
    boxes_uncovered: float = 1e-4
    time: tuple[float, float, float, float, float, float] = (0.25, 0.4, 0.5, 0.6, 0.8, 0.9)


@dataclass(frozen=True)
class ContactTuning:
    """What tunes each step from a surface to contact geometry; the defaults suit scans of places for robots.

    Attributes:
        repair: what of a mesh is kept.
        shapes: what counts as a terrain.
        subdivision: which meshes are cut finer.
        planes: how planes are found.
        slabs: how a terrain is cut.
        slab_fit: how caps are fitted to rough ground.
        seams: how pieces are mended.
        boxes: how pieces are turned into boxes.
        primitives: which planes become boxes, for the kind "primitives".
        union: how slabs are united for coacd.
        search: how coacd decomposes a body.
        selection: which of the results is taken.
    """

    repair: RepairConfig = field(default_factory=RepairConfig)
    shapes: ShapeConfig = field(default_factory=ShapeConfig)
    subdivision: SubdivisionConfig = field(default_factory=SubdivisionConfig)
    planes: PlaneConfig = field(default_factory=PlaneConfig)
    slabs: SlabConfig = field(default_factory=SlabConfig)
    slab_fit: SlabFitConfig = field(default_factory=SlabFitConfig)
    seams: SeamConfig = field(default_factory=SeamConfig)
    boxes: BoxConfig = field(default_factory=BoxConfig)
    primitives: PrimitiveConfig = field(default_factory=PrimitiveConfig)
    union: UnionConfig = field(default_factory=UnionConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    selection: SelectionConfig = field(default_factory=SelectionConfig)


@dataclass(frozen=True)
class ContactOptions:
    """What contact geometry is wanted.

    Attributes:
        accuracy: distance between contact and surface that is good enough [m].
        max_pieces: no more convex pieces than these.
        kind: one of `CONTACT_KINDS`.
        thickness: how far pieces reach below the lowest ground, or inwards from an overhang [m].
        seed: seed of coacd's search.
        time_limit: building ends by then, with what there is or an error [s].
        tuning: everything else.

    Raises:
        ArenaError: an option is out of range.
    """

    accuracy: float = 0.003
    max_pieces: int = 64
    kind: str = "convex"
    thickness: float = 0.2
    seed: int = 0
    time_limit: float = 120.0
    tuning: ContactTuning = field(default_factory=ContactTuning)

    def __post_init__(self) -> None:
        if self.kind not in CONTACT_KINDS:
            raise ArenaError(f"unknown kind of contact {self.kind!r}; there are: {', '.join(CONTACT_KINDS)}")
        for name in ("accuracy", "thickness", "time_limit"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ArenaError(f"{name} must be above 0, got {getattr(self, name)}")
        if self.max_pieces < 1:
            raise ArenaError(f"max_pieces must be 1 or more, got {self.max_pieces}")

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON; `tuning` only where it is not the default."""
        fields = asdict(self)
        return (
            fields if self.tuning != ContactTuning() else {k: v for k, v in fields.items() if k != "tuning"}
        )
