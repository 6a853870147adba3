"""From a repaired surface to contact geometry that meets an accuracy within a time."""

from __future__ import annotations

import logging
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import trimesh

from reconstruction.progress import Progress, silent
from symbrion_gym.contact.boxing import split_at_creases, turn_into_boxes
from symbrion_gym.contact.budget import Watch
from symbrion_gym.contact.decomposition import decompose
from symbrion_gym.contact.kinds import (
    CONTACT_KINDS,
    HeightField,
    find_uncovered,
    make_boxes,
    make_height_field,
    make_prisms,
)
from symbrion_gym.contact.mesh_repair import simplify
from symbrion_gym.contact.planes import Planes, find_planes
from symbrion_gym.contact.quality import ArenaQuality, BodyRuler, TerrainRuler, measure_arena
from symbrion_gym.contact.seams import mend_pieces
from symbrion_gym.contact.slab_fit import fit_slabs
from symbrion_gym.contact.slab_union import decompose_slabs, has_moved
from symbrion_gym.contact.slabs import make_slabs
from symbrion_gym.contact.solid import (
    close_downwards,
    close_holes,
    find_shape,
    simplify_solid,
    take_top,
    thicken,
)
from symbrion_gym.contact.subdivision import split_long_edges
from symbrion_gym.errors import ArenaError

_MAX_SOLID_FACES = 4000
"""coacd's time grows faster than the number of faces."""
_SHORT_SEARCH: dict[str, Any] = {
    "mcts_iterations": 60,
    "mcts_max_depth": 2,
    "mcts_nodes": 10,
    "resolution": 1000,
    "max_convex_hull": -1,
    "preprocess_mode": "off",
    "preprocess_resolution": 30,
}
"""coacd's own settings take five times as long on a scanned body and give no fewer pieces, and no closer ones."""
_SCALES = (1.0, 2.0, 4.0, 8.0)
"""Planes are looked for within these multiples of the accuracy, until few enough are found."""
_MAX_SLABS_FOR_COACD = 24
"""coacd's time grows faster than the number of slabs; of rough ground it also gives many more pieces."""
_COACD_SHARE = 0.5
"""coacd may use this share of the time limit, as processor time, for united slabs."""
_SHARE_OF_ONE = 0.4
"""coacd may use this share of the time limit, as processor time, for a body; what is left is for another attempt."""
_AS_CLOSE = 0.1
"""coacd's pieces are as good as the slabs if the mean and the 95th percentile of their distance from the surface are
larger by no more than this share of the accuracy."""
_AS_WIDE = 1e-4
"""And if no more than this share of the ground has no piece beneath it that had a slab."""
_AS_LITTLE = 1.1
"""What is no more than this many times the slabs' own is as good in any case."""
_MAX_FINISHED = 24
"""More pieces than these are left as they are: mending looks at every piece beside all others."""
_MAX_PARTS = 16
"""Pieces are not cut at creases into more parts than these."""
_BOXES_OFF = 3e-4
"""What boxes may add to the mean distance; twice as much to its 95th percentile [m]."""

Ruler = TerrainRuler | BodyRuler

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class ContactOptions:
    """What contact geometry is wanted.

    Attributes:
        accuracy: distance between contact and surface that is good enough [m].
        max_pieces: no more convex pieces than these.
        kind: one of `CONTACT_KINDS`.
        thickness: how far pieces reach below the lowest ground, or inwards from an overhang [m].
        seed: of coacd's search.
        time_limit: building ends by then, with what there is or an error [s].
    """

    accuracy: float = 0.003
    max_pieces: int = 64
    kind: str = "convex"
    thickness: float = 0.2
    seed: int = 0
    time_limit: float = 120.0

    def __post_init__(self) -> None:
        if self.kind not in CONTACT_KINDS:
            raise ArenaError(f"unknown kind of contact {self.kind!r}; there are: {', '.join(CONTACT_KINDS)}")
        for name in ("accuracy", "thickness", "time_limit"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ArenaError(f"{name} must be above 0, got {getattr(self, name)}")
        if self.max_pieces < 1:
            raise ArenaError(f"max_pieces must be 1 or more, got {self.max_pieces}")

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Contact:
    """What is touched, and how well it follows the surface.

    Attributes:
        pieces: convex solids.
        height_field: in place of pieces, for the kind "hfield".
        quality: distances from the surface.
        notes: how it came about, for JSON.
    """

    pieces: list[trimesh.Trimesh]
    quality: ArenaQuality
    height_field: HeightField | None = None
    notes: dict[str, Any] = field(default_factory=dict)


def make_contact(mesh: trimesh.Trimesh, options: ContactOptions, progress: Progress = silent) -> Contact:
    """Make contact geometry of a repaired surface; where other work on the machine cut it short, the notes tell.

    Raises:
        ArenaError: no geometry of this kind can be made of this surface in time.
    """
    watch = Watch(options.time_limit)
    contact = _make_contact(mesh, options, watch, progress)
    if not watch.was_kept_waiting:
        return contact
    _logger.warning(
        "the machine was busy for %.0f of %.0f s: the pieces may be more, or looser, than they could be; "
        "build the arena again when it is free",
        watch.elapsed - watch.spent,
        watch.elapsed,
    )
    return replace(contact, notes={**contact.notes, "was_kept_waiting": True})


def _make_contact(
    mesh: trimesh.Trimesh, options: ContactOptions, watch: Watch, progress: Progress
) -> Contact:
    if options.kind == "prisms":
        return _measure(make_prisms(mesh), TerrainRuler(mesh), watch, {"way": "prisms"})
    if options.kind == "hfield":
        heights = make_height_field(mesh)
        quality = measure_arena([heights.as_mesh()], mesh, seconds=watch.elapsed)
        return Contact([], quality, heights, {"way": "height field"})
    shape = find_shape(mesh)
    body = close_holes(mesh) if shape == "overhang" else mesh
    if body is not mesh and body.is_watertight:
        shape = "closed"
    progress(f"the surface is a {shape}", 0.05)
    if shape == "terrain":
        return _follow_terrain(split_long_edges(take_top(mesh)), TerrainRuler(mesh), options, watch, progress)
    solid = body if shape == "closed" else thicken(mesh, _limit_thickness(mesh, options.thickness))
    return _decompose_solid(solid, BodyRuler(mesh), options, watch, progress, {"shape": shape})


def _follow_terrain(
    top: trimesh.Trimesh, ruler: TerrainRuler, options: ContactOptions, watch: Watch, progress: Progress
) -> Contact:
    """Slabs under planes, the finest that are few enough, caps fitted where planes do not do; then coacd."""
    progress("planes", 0.1)
    planes, tolerance = _find_few_planes(top, options, watch)
    progress("slabs", 0.3)
    slabs, pieces = make_slabs(
        top, planes, tolerance, options.max_pieces, options.thickness, lambda: watch.is_late(0.4)
    )
    if options.kind == "convex" and len(pieces) <= _MAX_FINISHED:
        progress("mending seams", 0.4)
        pieces = mend_pieces(pieces, top, lambda: watch.is_late(0.5))
    if options.kind == "primitives":
        boxes = make_boxes(top, planes, tolerance)
        pieces = boxes + find_uncovered(pieces, boxes, tolerance)
    notes = {"way": "slabs", "tolerance": tolerance, "planes": len(planes.normals), "noise": planes.noise}
    best = _measure(pieces, ruler, watch, notes)
    if _is_enough(best, max(options.accuracy, 1.5 * planes.noise), options):
        return _prefer_coacd(best, planes, top, ruler, options, watch, progress)
    if slabs and not watch.is_late():
        progress("fitting caps to rough ground", 0.5)
        pieces = fit_slabs(
            top,
            slabs,
            planes.slopes(),
            options.accuracy,
            options.max_pieces,
            options.thickness,
            lambda: watch.is_late(0.6),
        )
        fitted = _measure(pieces, ruler, watch, {**notes, "way": "slabs, fitted"})
        best = _choose(best, fitted, options.max_pieces)
    if _is_enough(best, 3.0 * options.accuracy, options):
        return _prefer_coacd(best, planes, top, ruler, options, watch, progress)
    if best.pieces and watch.is_late():
        return best
    try:
        solid = simplify_solid(close_downwards(top, options.thickness))
        other = _decompose_solid(solid, ruler, options, watch, progress, {"shape": "terrain"})
        return _choose(best, other, options.max_pieces)
    except ArenaError as error:
        if not best.pieces:
            raise
        _logger.info("coacd gave nothing better: %s", error)
        return best


def _prefer_coacd(
    slabs: Contact,
    planes: Planes,
    top: trimesh.Trimesh,
    ruler: Ruler,
    options: ContactOptions,
    watch: Watch,
    progress: Progress,
) -> Contact:
    """coacd's pieces of the united slabs where they follow the surface as well; else the slabs, and why."""
    if options.kind != "convex":
        return slabs
    way = slabs.notes["way"]
    made, reason = None, ""
    if len(slabs.pieces) > _MAX_SLABS_FOR_COACD:
        reason = f"{len(slabs.pieces)} slabs would take coacd too long"
    else:
        progress("coacd", 0.7)
        limits = 0.8 * watch.left(), _COACD_SHARE * options.time_limit
        try:
            pieces = decompose_slabs(slabs.pieces, planes, top.area_faces, options.seed, *limits)
            mended = _mend(pieces, top, options.max_pieces, watch) if len(pieces) <= _MAX_FINISHED else pieces
            for candidate in (mended, pieces):  # coacd leaves slits; to mend them may cost accuracy
                made = _measure(candidate, ruler, watch, {**slabs.notes, "way": f"coacd of {way}"})
                reason = _find_fault(made, slabs, options.max_pieces, options.accuracy)
                if not reason:
                    break
        except ArenaError as error:
            reason = str(error)
    if made is not None and not reason:
        chosen = replace(made, notes={**made.notes, "why": f"as close as the {len(slabs.pieces)} slabs"})
    else:
        _logger.info("slabs are kept: %s", reason)
        chosen = replace(slabs, notes={**slabs.notes, "why": f"slabs are kept: {reason}"})
    return _finish(chosen, top, ruler, options, watch, progress)


def _finish(
    contact: Contact,
    top: trimesh.Trimesh,
    ruler: Ruler,
    options: ContactOptions,
    watch: Watch,
    progress: Progress,
) -> Contact:
    """Seams mended, pieces cut at creases and turned into boxes, as far as that moves no ground."""
    best = replace(contact, quality=replace(contact.quality, seconds=watch.elapsed))
    if len(contact.pieces) > _MAX_FINISHED:
        return best
    progress("seams and boxes", 0.9)
    for improve in (_mend, _box):
        pieces = improve(best.pieces, top, options.max_pieces, watch)
        made = _measure(pieces, ruler, watch, contact.notes)
        is_as_close = (
            made.quality.mean <= contact.quality.mean + _BOXES_OFF
            and made.quality.p95 <= contact.quality.p95 + 2 * _BOXES_OFF
            and made.quality.uncovered <= contact.quality.uncovered + 1e-4
        )
        best = made if is_as_close else replace(best, quality=replace(best.quality, seconds=watch.elapsed))
    return best


def _mend(
    pieces: list[trimesh.Trimesh], top: trimesh.Trimesh, max_pieces: int, watch: Watch
) -> list[trimesh.Trimesh]:
    return mend_pieces(pieces, top, lambda: watch.is_late(0.8))


def _box(
    pieces: list[trimesh.Trimesh], top: trimesh.Trimesh, max_pieces: int, watch: Watch
) -> list[trimesh.Trimesh]:
    parts = split_at_creases(pieces, min(max_pieces, max(_MAX_PARTS, len(pieces))))
    return turn_into_boxes(parts, top, lambda: watch.is_late(0.9))


def _find_fault(made: Contact, slabs: Contact, max_pieces: int, accuracy: float) -> str:
    """What is worse about coacd's pieces than about the slabs that they cover; nothing if they are as good."""
    allowed = min(max_pieces, max(int(1.5 * len(slabs.pieces)), len(slabs.pieces) + 3))
    if len(made.pieces) > allowed:
        return f"coacd gave {len(made.pieces)} pieces for {len(slabs.pieces)} slabs"
    margins = {"mean": _AS_CLOSE * accuracy, "p95": _AS_CLOSE * accuracy, "uncovered": _AS_WIDE}
    for name, margin in margins.items():
        got, kept = getattr(made.quality, name), getattr(slabs.quality, name)
        if got > max(_AS_LITTLE * kept, kept + margin):
            return f"coacd's pieces have {name} {got:.3g} against {kept:.3g}"
    return "coacd's pieces move walls" if has_moved(made.pieces, slabs.pieces) else ""


def _find_few_planes(top: trimesh.Trimesh, options: ContactOptions, watch: Watch) -> tuple[Planes, float]:
    """The finest planes that are few enough, or about as few as coarser ones; and their tolerance."""
    found = []
    for scale in _SCALES:
        planes = find_planes(top, scale * options.accuracy, is_late=lambda: watch.is_late(0.25))
        found.append((planes, scale * options.accuracy))
        if len(planes.normals) <= max(options.max_pieces / 2, 8) or watch.is_late(0.25):
            return found[-1]
    fewest = min(len(planes.normals) for planes, _ in found)
    return next(pair for pair in found if len(pair[0].normals) <= 1.25 * fewest)


def _is_enough(contact: Contact, accuracy: float, options: ContactOptions) -> bool:
    return 0 < len(contact.pieces) <= options.max_pieces and contact.quality.mean <= accuracy


def _decompose_solid(
    solid: trimesh.Trimesh,
    ruler: Ruler,
    options: ContactOptions,
    watch: Watch,
    progress: Progress,
    notes: dict[str, Any],
) -> Contact:
    """coacd with finer and finer thresholds, until the accuracy is met or pieces or time run out.

    A solid that coacd cannot end with (one that folds through itself) is tried again as coacd's own remeshing has it.
    """
    if len(solid.faces) > _MAX_SOLID_FACES:
        solid = _simplify(solid, _MAX_SOLID_FACES)
    best: Contact | None = None
    begin = 0.6 if notes["shape"] == "terrain" else 0.4

    def attempt(threshold: float, share: float = _SHARE_OF_ONE, **more: Any) -> Contact:
        progress(f"coacd at threshold {threshold}", min(begin + 0.3 * watch.spent / options.time_limit, 0.9))
        limits = max((1.0 + share) / 2 * watch.left(), 1.0), share * options.time_limit
        pieces = decompose(solid, threshold, options.seed, *limits, **{**_SHORT_SEARCH, **more})
        return _measure(pieces, ruler, watch, {**notes, "way": "coacd", "threshold": threshold})

    for threshold in (0.05, 0.02, 0.01):
        if best is not None and watch.is_late(0.25):
            break
        try:
            made = attempt(threshold)
            best = _choose(best, made, options.max_pieces)
            if len(made.pieces) > options.max_pieces and not watch.is_late(0.5):
                fewer = attempt(threshold, max_convex_hull=options.max_pieces)
                best = _choose(best, fewer, options.max_pieces)
        except ArenaError as error:
            _logger.info("coacd at threshold %g: %s", threshold, error)
            break
        # A finer threshold gives twice as many.
        if 2 * len(made.pieces) > options.max_pieces or made.quality.mean <= options.accuracy:
            break
    if best is None:
        solid = _simplify(solid, _MAX_SOLID_FACES // 4)
        best = attempt(0.1, share=1.0, preprocess_mode="on", max_convex_hull=options.max_pieces)
    return replace(best, quality=replace(best.quality, seconds=watch.elapsed))


def _simplify(solid: trimesh.Trimesh, count: int) -> trimesh.Trimesh:
    return trimesh.Trimesh(*simplify(solid.vertices, solid.faces, count), process=False)


def _measure(pieces: list[trimesh.Trimesh], ruler: Ruler, watch: Watch, notes: dict[str, Any]) -> Contact:
    return Contact(pieces, ruler.measure(pieces, watch.elapsed), None, notes)


def _choose(first: Contact | None, second: Contact, max_pieces: int) -> Contact:
    """The one that keeps to the number of pieces; of two, the more accurate."""
    if first is None:
        return second

    def rank(contact: Contact) -> tuple[int, float]:
        too_many = max(len(contact.pieces) - max_pieces, 0)
        return too_many, contact.quality.mean + contact.quality.uncovered

    return min(first, second, key=rank)


def _limit_thickness(mesh: trimesh.Trimesh, thickness: float) -> float:
    """A shell no thicker than a tenth of the extent: small things stay hollow where they were."""
    return min(thickness, 0.1 * float(mesh.extents.max()))
