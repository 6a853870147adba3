"""Contact geometry made again only where its surface has changed: all other pieces stay, to the bit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.progress import silent
from reconstruction._src.geometry.orientation import find_components
from reconstruction._src.geometry.rows import all_corners
from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.networks.change.neighborhoods import widen
from symbrion_gym._src.contact.acceptance import find_miss
from symbrion_gym._src.contact.builder import PASSES, Pass, run_passes
from symbrion_gym._src.contact.contact import Contact
from symbrion_gym._src.contact.deadline import Deadline
from symbrion_gym._src.contact.inside import ConvexSolids
from symbrion_gym._src.contact.local_changes import (
    UPDATE_DEFAULTS,
    LocalChanges,
    UpdateConfig,
    find_heights,
    find_local_changes,
    measure_gaps,
    sample_faces,
)
from symbrion_gym._src.contact.options import ContactOptions
from symbrion_gym._src.contact.passes.finish import stop_clock
from symbrion_gym._src.contact.passes.patches import fit_flat_patches, fit_patches
from symbrion_gym._src.contact.passes.slabs import fit_slabs
from symbrion_gym._src.contact.problem import ContactProblem
from symbrion_gym._src.contact.solid import Shape
from symbrion_gym._src.errors import ArenaError

_PATCHES = (fit_flat_patches, fit_patches)
"""Passes for a changed part of any shape: those that decompose whole bodies cost more than they save there."""
_FEW_FACES = 4
"""Fewer faces in one place hold no surface: the pieces around them serve."""


class LocalUpdate(NamedTuple):
    """What came of an update.

    Attributes:
        contact: of the whole new surface; None where all must be made again.
        reason: why, in words; nothing where there is contact.
        notes: how many pieces stayed, went and came, for JSON.
    """

    contact: Contact | None
    reason: str
    notes: dict[str, Any]


def update_contact(
    old: trimesh.Trimesh,
    new: trimesh.Trimesh,
    pieces: list[trimesh.Trimesh],
    options: ContactOptions,
    accuracy: float,
    old_miss: float = 1.0,
    is_two_sided: Bool[np.ndarray, " F"] | None = None,
    config: UpdateConfig = UPDATE_DEFAULTS,
) -> LocalUpdate:
    """Return contact geometry of a surface that has changed in parts.

    Pieces that stand where nothing is any more go; what the others do not follow gets new ones. The result is accepted
    by the rule that accepts contact geometry of a whole surface, which it must meet in the changed part, too.

    Args:
        old: the surface that the pieces were made of.
        new: the surface now, repaired; what did not change is equal to the bit.
        pieces: convex solids.
        options: what is wanted.
        accuracy: wanted distance [m].
        old_miss: how far the pieces missed it on the old surface (`find_miss`).
        is_two_sided: which faces of the new surface were seen from behind, too.
        config: what counts as changed.
    """
    changes = find_local_changes(old, new, pieces, accuracy, config)
    areas = new.area_faces
    share = float(areas[changes.is_open].sum() / areas.sum())
    notes: dict[str, Any] = {
        "changed_area": float(areas[changes.is_changed].sum() / areas.sum()),
        "rebuilt_area": share,
        "kept": int((~changes.is_removed).sum()),
        "removed": int(changes.is_removed.sum()),
    }
    if share > config.most_area:
        return LocalUpdate(None, f"{share:.0%} of the surface needs other contact geometry", notes)
    kept = [piece for piece, gone in zip(pieces, changes.is_removed, strict=True) if not gone]
    problem = ContactProblem(new, options, accuracy, Deadline(options.time_limit), silent, is_two_sided)
    made = _make_parts(problem, changes.is_open, config)
    notes["made"] = len(made)
    contact = problem.measure(kept + made, {"way": "updated"})
    reason = _find_fault(problem, contact, made, changes, max(old_miss, 1.0), config)
    return LocalUpdate(None if reason else stop_clock(problem, contact), reason, notes)


def _make_parts(
    problem: ContactProblem, is_open: Bool[np.ndarray, " F"], config: UpdateConfig
) -> list[trimesh.Trimesh]:
    """Return convex solids for each connected part of the open faces: slabs where these do for a terrain, else patches.

    The planes of slabs are found with some of the surface around; patches need only the part itself.
    """
    mesh, kind = problem.surface, problem.options.kind
    faces = np.asarray(mesh.faces)
    is_corner = np.zeros(len(mesh.vertices), dtype=bool)
    is_corner[faces[is_open]] = True
    around = np.flatnonzero(all_corners(widen(faces, is_corner, config.context_rings), faces))
    if not len(around):
        return []
    limit = config.tolerance * problem.accuracy
    numbers = find_components(faces[around], len(mesh.vertices))
    found: list[trimesh.Trimesh] = []
    for number in range(numbers.max() + 1):
        own = around[numbers == number]
        rows = own[is_open[own]]
        if len(rows) < _FEW_FACES:
            continue
        pieces: list[trimesh.Trimesh] = []
        if problem.shape == "terrain" and kind in ("auto", "convex"):
            pieces = _drop_idle(mesh, rows, _build(problem, own, (fit_slabs,), config), limit)
        if not pieces:
            pieces = _build(
                problem, rows, PASSES[kind] if kind in ("primitives", "prisms") else _PATCHES, config
            )
        found += pieces
    return found


def _build(
    problem: ContactProblem, rows: Int[np.ndarray, " R"], passes: tuple[Pass, ...], config: UpdateConfig
) -> list[trimesh.Trimesh]:
    """Return convex solids for some faces; none where slabs miss what is wanted, or nothing can be made."""
    mesh, options = problem.surface, problem.options
    used, flat = np.unique(np.asarray(mesh.faces)[rows], return_inverse=True)
    surface = trimesh.Trimesh(np.asarray(mesh.vertices)[used], flat.reshape(-1, 3), process=False)
    share = max(float(surface.area / mesh.area), config.least_share)
    backs = None if problem.is_two_sided is None else problem.is_two_sided[rows]
    shape: Shape | None = "terrain" if problem.shape == "terrain" else None
    part = ContactProblem(
        surface, _scale_effort(options, share), problem.accuracy, problem.deadline, silent, backs, shape
    )
    try:
        made = run_passes(part, passes)
    except ArenaError:  # nothing that a robot could touch
        return []
    miss = find_miss(made, problem.accuracy, options.max_pieces, options.config.acceptance)
    return [] if passes == (fit_slabs,) and miss > 1.0 else made.pieces


def _drop_idle(
    mesh: trimesh.Trimesh, rows: Int[np.ndarray, " R"], pieces: list[trimesh.Trimesh], limit: float
) -> list[trimesh.Trimesh]:
    """Return the pieces without those that no face in question needs: they stand for what lies around.

    Args:
        mesh: the surface.
        rows: its faces in question.
        pieces: made for these and what lies around.
        limit: distance up to which a piece follows a face [m].
    """
    places, normals = sample_faces(mesh, rows)
    gaps = [measure_gaps(places, normals, [piece]) <= limit for piece in pieces]
    needed = list(range(len(pieces)))
    for row in sorted(needed, key=lambda row: int(gaps[row].sum())):
        others = [gaps[other] for other in needed if other != row]
        if others and not (gaps[row] & ~np.any(others, axis=0)).any():
            needed.remove(row)
    return [pieces[row] for row in needed]


def _scale_effort(options: ContactOptions, share: float) -> ContactOptions:
    """Return options that look at as many points a square meter as for the whole surface."""
    config = options.config
    distance = replace(config.distance, num_points=max(int(share * config.distance.num_points), 1))
    slabs = replace(config.slabs, num_points=max(int(share * config.slabs.num_points), 1))
    return replace(options, config=replace(config, distance=distance, slabs=slabs))


def _find_fault(
    problem: ContactProblem,
    contact: Contact,
    made: list[trimesh.Trimesh],
    changes: LocalChanges,
    most: float,
    config: UpdateConfig,
) -> str:
    """Return why updated contact geometry is not good enough, on the whole, in the changed part, or at seams."""
    acceptance, count = problem.config.acceptance, problem.options.max_pieces
    before, now = len(changes.is_removed), len(contact.pieces)
    if now > max(config.more_pieces * before, before + config.more_few):
        return f"there would be {now} pieces instead of {before}"
    miss = find_miss(contact, problem.accuracy, count, acceptance)
    if miss > most:
        return f"the whole misses what is wanted {miss:.3g}-fold"
    places, normals = _sample(problem.surface, changes.is_open | changes.is_changed, config)
    if not len(places):
        return ""
    gaps = measure_gaps(places, normals, contact.pieces)
    mean, p95 = float(gaps.mean()), float(np.percentile(gaps, 95))
    if mean > most * problem.accuracy or p95 > most * acceptance.p95 * problem.accuracy:
        return f"the changed part is {mean * 1e3:.3g} mm off in the mean, {p95 * 1e3:.3g} mm at the 95th percentile"
    step = _measure_steps(problem, made, contact.pieces, config)
    if step > acceptance.p95 * problem.accuracy:
        return f"new pieces stand {step * 1e3:.3g} mm in front of the surface at the 95th percentile"
    return ""


def _sample(
    mesh: trimesh.Trimesh, is_part: Bool[np.ndarray, " F"], config: UpdateConfig
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Return places on faces, and where these look."""
    rows: Int[np.ndarray, " R"] = np.flatnonzero(is_part & (mesh.area_faces > 0))
    if not len(rows):
        return np.zeros((0, 3)), np.zeros((0, 3))
    number = max(config.least_points // len(rows) + 1, 1)
    rng = np.random.default_rng(0)
    shares = rng.dirichlet(np.ones(3), size=(len(rows), number))
    places = np.einsum("fnc,fci->fni", shares, mesh.triangles[rows]).reshape(-1, 3)
    return places, np.repeat(mesh.face_normals[rows], number, axis=0)


def _measure_steps(
    problem: ContactProblem, made: list[trimesh.Trimesh], pieces: list[trimesh.Trimesh], config: UpdateConfig
) -> float:
    """Return how far new pieces stand in front of the surface at 95 of 100 places that a robot can touch [m]."""
    if not made:
        return 0.0
    solids = ConvexSolids(made)
    places = sample_area(solids.vertices, solids.faces, config.least_points)
    distance = problem.config.distance
    places = places[ConvexSolids(pieces).find_depths(places) <= distance.inside]
    heights = find_heights(places, problem.surface)
    heights = heights[heights > -distance.uncovered]
    return float(np.percentile(np.maximum(heights, 0.0), 95)) if len(heights) else 0.0
