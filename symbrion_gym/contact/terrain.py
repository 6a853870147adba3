"""Contact geometry of a terrain: slabs under planes, caps where planes do not do, coacd where it is as good."""

from __future__ import annotations

import logging
from dataclasses import replace

import trimesh

from reconstruction.geometry.decimation import simplify
from reconstruction.geometry.elevation import Elevation
from symbrion_gym.contact.boxing import split_at_creases, turn_into_boxes
from symbrion_gym.contact.coacd_search import decompose_solid
from symbrion_gym.contact.contact import Contact, select_best
from symbrion_gym.contact.job import ContactJob
from symbrion_gym.contact.kinds import make_prisms
from symbrion_gym.contact.planes import Planes, find_planes
from symbrion_gym.contact.primitives import find_uncovered, make_boxes
from symbrion_gym.contact.seams import mend_pieces
from symbrion_gym.contact.slab_fit import fit_slabs
from symbrion_gym.contact.slab_union import decompose_slabs, has_moved
from symbrion_gym.contact.slabs import Slab, make_slabs
from symbrion_gym.contact.solid import close_downwards, simplify_solid
from symbrion_gym.errors import ArenaError

_logger = logging.getLogger(__name__)


def follow_terrain(job: ContactJob, top: trimesh.Trimesh) -> Contact:
    """Make the finest slabs that are few enough, fit caps where planes do not do; then let coacd try.

    Args:
        job: what is wanted.
        top: open terrain, normals up.

    Raises:
        ReconstructionError: no face with an area is left of it.
    """
    options, tuning = job.options, job.tuning
    ground = Elevation(top)
    planes, slabs, best = _make_slabs(job, top, ground)
    enough = max(options.accuracy, tuning.selection.noise_accuracy * planes.noise)
    if job.is_enough(best, enough):
        return _prefer_coacd(job, best, planes, top, ground)
    if slabs and not job.budget.is_exceeded():
        fitted = _fit_caps(job, top, ground, planes, slabs, best)
        best = select_best([best, fitted], options.max_pieces)
    if job.is_enough(best, tuning.selection.fitted_accuracy * options.accuracy):
        return _prefer_coacd(job, best, planes, top, ground)
    if best.pieces and job.budget.is_exceeded():
        return best
    try:
        solid = simplify_solid(close_downwards(top, options.thickness), tuning.shapes)
        return select_best([best, decompose_solid(job, solid, "terrain")], options.max_pieces)
    except ArenaError as error:
        _logger.info("coacd gave nothing better: %s", error)
        return best if best.pieces else _make_coarse_prisms(job, top, str(error))


def _make_coarse_prisms(job: ContactJob, top: trimesh.Trimesh, reason: str) -> Contact:
    """Return a prism for each triangle of the terrain, simplified to as many as pieces are allowed.

    There is always time for this; the quality says how coarse it is.
    """
    _logger.warning("neither slabs nor coacd gave pieces in time (%s); a coarse surface is used", reason)
    coarse = trimesh.Trimesh(*simplify(top.vertices, top.faces, job.options.max_pieces), process=False)
    return job.measure(make_prisms(coarse), {"way": "coarse prisms", "why": reason})


def _make_slabs(
    job: ContactJob, top: trimesh.Trimesh, ground: Elevation
) -> tuple[Planes, list[Slab], Contact]:
    """Return planes of a terrain, slabs under them, and what they are worth as contact."""
    options, tuning = job.options, job.tuning
    _, cutting_ends, mending_ends, *_ = tuning.selection.time
    job.progress("planes", 0.1)
    planes, tolerance = _find_few_planes(job, top)
    job.progress("slabs", 0.3)
    slabs, pieces = make_slabs(
        top,
        ground,
        planes,
        tolerance,
        options.max_pieces,
        options.thickness,
        job.ends_at(cutting_ends),
        tuning.slabs,
    )
    if options.kind == "convex" and len(pieces) <= tuning.selection.max_finished:
        job.progress("mending seams", 0.4)
        pieces = mend_pieces(pieces, ground, job.ends_at(mending_ends), tuning.seams)
    if options.kind == "primitives":
        boxes = make_boxes(top, ground, planes, tolerance, tuning.primitives)
        pieces = boxes + find_uncovered(pieces, boxes, tolerance, tuning.primitives)
    notes = {"way": "slabs", "tolerance": tolerance, "planes": len(planes.normals), "noise": planes.noise}
    return planes, slabs, job.measure(pieces, notes)


def _fit_caps(
    job: ContactJob,
    top: trimesh.Trimesh,
    ground: Elevation,
    planes: Planes,
    slabs: list[Slab],
    contact: Contact,
) -> Contact:
    """Return slabs fitted to rough ground."""
    job.progress("fitting caps to rough ground", 0.5)
    pieces = fit_slabs(
        top,
        ground,
        slabs,
        planes.slopes(),
        job.options.accuracy,
        job.options.max_pieces,
        job.options.thickness,
        job.ends_at(job.tuning.selection.time[3]),
        job.tuning.slab_fit,
    )
    return job.measure(pieces, {**contact.notes, "way": "slabs, fitted"})


def _find_few_planes(job: ContactJob, top: trimesh.Trimesh) -> tuple[Planes, float]:
    """Return the finest planes that are few enough, or about as few as coarser ones; and their tolerance."""
    selection, accuracy = job.tuning.selection, job.options.accuracy
    is_exceeded = job.ends_at(selection.time[0])
    few = max(selection.planes_share * job.options.max_pieces, selection.min_planes)
    found = []
    for scale in selection.scales:
        planes = find_planes(top, scale * accuracy, is_exceeded=is_exceeded, config=job.tuning.planes)
        found.append((planes, scale * accuracy))
        if len(planes.normals) <= few or is_exceeded():
            return found[-1]
    fewest = min(len(planes.normals) for planes, _ in found)
    return next(pair for pair in found if len(pair[0].normals) <= selection.similar_planes * fewest)


def _prefer_coacd(
    job: ContactJob, slabs: Contact, planes: Planes, top: trimesh.Trimesh, ground: Elevation
) -> Contact:
    """Return coacd's pieces of the united slabs where they follow the surface as well; else the slabs, and why."""
    if job.options.kind != "convex":
        return slabs
    made, fault = _try_coacd(job, slabs, planes, top, ground)
    if made is not None and not fault:
        reason = f"as close as the {len(slabs.pieces)} slabs"
        selected = replace(made, notes={**made.notes, "why": reason})
    else:
        _logger.info("slabs are kept: %s", fault)
        selected = replace(slabs, notes={**slabs.notes, "why": f"slabs are kept: {fault}"})
    return _finish(job, selected, ground)


def _try_coacd(
    job: ContactJob, slabs: Contact, planes: Planes, top: trimesh.Trimesh, ground: Elevation
) -> tuple[Contact | None, str]:
    """Return coacd's pieces of the united slabs, if any, and what is worse about them; nothing if they are as good."""
    selection, options = job.tuning.selection, job.options
    if len(slabs.pieces) > selection.max_slabs:
        return None, f"{len(slabs.pieces)} slabs would take coacd too long"
    job.progress("coacd", 0.7)
    limits = selection.coacd_clock * job.budget.left(), selection.coacd_share * options.time_limit
    made, fault = None, ""
    try:
        pieces = decompose_slabs(
            slabs.pieces, planes, top.area_faces, options.seed, *limits, job.tuning.union
        )
        is_mended = len(pieces) <= selection.max_finished
        mended = _mend(job, pieces, ground) if is_mended else pieces
        for candidate in (mended, pieces):  # coacd leaves slits; to mend them may cost accuracy
            made = job.measure(candidate, {**slabs.notes, "way": f"coacd of {slabs.notes['way']}"})
            fault = _find_fault(job, made, slabs)
            if not fault:
                break
    except ArenaError as error:
        fault = str(error)
    return made, fault


def _find_fault(job: ContactJob, made: Contact, slabs: Contact) -> str:
    """Return what is worse about coacd's pieces than about the slabs that they cover; nothing if they are as good."""
    selection, count = job.tuning.selection, len(slabs.pieces)
    more = max(int(selection.more_pieces * count), count + selection.more_few)
    if len(made.pieces) > min(job.options.max_pieces, more):
        return f"coacd gave {len(made.pieces)} pieces for {count} slabs"
    close = selection.as_close * job.options.accuracy
    margins = {"mean": close, "p95": close, "uncovered": selection.as_wide}
    for name, margin in margins.items():
        got, kept = getattr(made.quality, name), getattr(slabs.quality, name)
        if got > max(selection.as_little * kept, kept + margin):
            return f"coacd's pieces have {name} {got:.3g} against {kept:.3g}"
    moved = has_moved(made.pieces, slabs.pieces, job.tuning.union)
    return "coacd's pieces move walls" if moved else ""


def _finish(job: ContactJob, contact: Contact, ground: Elevation) -> Contact:
    """Mend seams, cut pieces at creases and turn them into boxes, as far as that moves no ground."""
    selection, before = job.tuning.selection, contact.quality
    best = job.stop(contact)
    if len(contact.pieces) > selection.max_finished:
        return best
    job.progress("seams and boxes", 0.9)
    for improve in (_mend, _box):
        made = job.measure(improve(job, best.pieces, ground), contact.notes)
        is_as_close = (
            made.quality.mean <= before.mean + selection.boxes_off
            and made.quality.p95 <= before.p95 + 2 * selection.boxes_off
            and made.quality.uncovered <= before.uncovered + selection.boxes_uncovered
        )
        best = made if is_as_close else job.stop(best)
    return best


def _mend(job: ContactJob, pieces: list[trimesh.Trimesh], ground: Elevation) -> list[trimesh.Trimesh]:
    return mend_pieces(pieces, ground, job.ends_at(job.tuning.selection.time[4]), job.tuning.seams)


def _box(job: ContactJob, pieces: list[trimesh.Trimesh], ground: Elevation) -> list[trimesh.Trimesh]:
    most = min(job.options.max_pieces, max(job.tuning.selection.max_parts, len(pieces)))
    parts = split_at_creases(pieces, most, job.tuning.boxes)
    return turn_into_boxes(parts, ground, job.tuning.boxes, job.ends_at(job.tuning.selection.time[5]))
