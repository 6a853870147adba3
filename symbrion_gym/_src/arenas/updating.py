"""An arena that follows its place: contact geometry is made again only where the surface has changed."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from reconstruction._src.base.progress import Progress, silent
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.ground_friction import GroundFriction, choose_friction
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.arenas.placed_objects import name_objects
from symbrion_gym._src.arenas.scan_quality import add_scan_quality
from symbrion_gym._src.arenas.scanned import ScannedSurface, find_two_sided, repair_surface, take_surface
from symbrion_gym._src.arenas.seen_places import choose_positions
from symbrion_gym._src.contact.acceptance import find_miss
from symbrion_gym._src.contact.contact import Contact
from symbrion_gym._src.contact.default_accuracy import find_accuracy
from symbrion_gym._src.contact.local_changes import UPDATE_DEFAULTS, UpdateConfig, find_changed_faces
from symbrion_gym._src.contact.local_update import update_contact
from symbrion_gym._src.contact.options import ContactConfig, ContactOptions
from symbrion_gym._src.errors import ArenaError

if TYPE_CHECKING:
    from reconstruction._src.reconstruction import Reconstruction
    from reconstruction._src.slip.patches import FrictionEstimate

logger = logging.getLogger(__name__)
_NEAR_OBJECT = 0.03
"""Changes this near to the box of a known object concern it [m]."""


def update_arena(
    arena: Arena,
    surface: Reconstruction | trimesh.Trimesh | str | Path,
    *,
    viewpoints: ArrayLike | None = None,
    config: ContactConfig | None = None,
    update: UpdateConfig = UPDATE_DEFAULTS,
    progress: Progress = silent,
) -> Arena:
    """Return the arena with contact geometry made again only where the surface has changed.

    Pieces elsewhere stay equal to the bit, and so does everything else that the arena knows. Friction that robots have
    felt (`Reconstruction.friction`) becomes that of the arena, unless a user gave its friction; pieces are cut where it
    changes. The whole is measured and accepted as a new arena's would be; where it is not good enough, all is built
    again, and `Arena.provenance["update"]` says why. The same surface and friction give the same arena.

    Args:
        arena: made of the surface before.
        surface: what it is now: a reconstruction, as `Reconstruction.refine` returns it, a mesh, or a file of either,
            in the frame of the first.
        viewpoints: `[3]` or `[K, 3]` positions of the sensor, where a mesh is given [m].
        config: everything that shapes the pieces, if it was given to `make_arena`, too.
        update: what counts as changed.
        progress: called with what is being done and the share done.

    Raises:
        ArenaError: the arena is an exact course, or the surface cannot be used or is in another frame.
    """
    if arena.course is not None:
        raise ArenaError(
            f"arena {arena.name!r} is an exact course, which no scan updates; make an arena of a scan first: "
            "make_arena(reconstruction)"
        )
    options = _read_options(arena, config)
    scanned = take_surface(surface, viewpoints)
    if not np.array_equal(scanned.offset, arena.offset):
        raise ArenaError(
            f"the surface lies at an offset of {scanned.offset} m, the arena at {arena.offset} m; give the "
            "surface that the arena was made of, refined"
        )
    progress("repairing the mesh", 0.0)
    mesh = repair_surface(scanned, options.config.repair)
    ground = _update_friction(arena, scanned.friction)
    has_patches = ground.friction_map is not None and bool(ground.friction_map.patches)
    needs_pieces = arena.height_field is not None and has_patches
    if not needs_pieces and not any(
        part.any() for part in find_changed_faces(arena.surface, mesh, update.digits)
    ):
        progress("done", 1.0)
        return _lay_friction(arena, ground)
    accuracy = arena.provenance.get("accuracy") or find_accuracy(
        mesh, scanned.points, options.config.accuracy
    )
    if arena.height_field is not None:
        why = "a height field is one piece"
        return _build_again(arena, surface, viewpoints, options, why, {}, ground, progress)
    progress("finding what has changed", 0.2)
    before = Contact(arena.pieces, arena.quality)
    miss = find_miss(before, accuracy, options.max_pieces, options.config.acceptance)
    backs = find_two_sided(scanned, mesh)
    found = update_contact(arena.surface, mesh, arena.pieces, options, accuracy, miss, backs, update)
    if found.contact is None:
        return _build_again(arena, surface, viewpoints, options, found.reason, found.notes, ground, progress)
    progress("done", 1.0)
    _tell_of_objects(arena, mesh, update)
    updated = _replace(arena, mesh, scanned, found.contact, accuracy, found.notes, options)
    return _lay_friction(updated, ground)


def _update_friction(arena: Arena, felt: FrictionEstimate | None) -> GroundFriction:
    """Return the friction that an arena is to have: what robots felt, unless a user or a course gave another."""
    if felt is None or arena.friction_source not in ("assumed", "estimated"):
        return GroundFriction(arena.friction, arena.friction_source, arena.friction_map)
    return choose_friction(None, None, None, felt)


def _lay_friction(arena: Arena, ground: GroundFriction) -> Arena:
    """Return an arena with a friction: the same where it has it already."""
    if ground == (arena.friction, arena.friction_source, arena.friction_map):
        return arena
    patches = 0 if ground.friction_map is None else len(ground.friction_map.patches)
    notes = {**arena.provenance.get("update", {}), "friction_patches": patches}
    return replace(
        arena,
        friction=ground.friction,
        friction_source=ground.source,
        friction_map=ground.friction_map,
        provenance={**arena.provenance, "update": notes},
    )


def _read_options(arena: Arena, config: ContactConfig | None) -> ContactOptions:
    """Return what the arena was made with.

    Raises:
        ArenaError: it was made with a configuration of its own, which is not given.
    """
    known: dict[str, Any] = dict(arena.provenance.get("options", {}))
    if known.pop("config", None) is not None and config is None:
        raise ArenaError(
            f"arena {arena.name!r} was made with a configuration of its own; give it as config again"
        )
    names = ("accuracy", "max_pieces", "kind", "thickness", "seed", "time_limit")
    given = {name: known[name] for name in names if name in known}
    return ContactOptions(**given, config=config or ContactConfig())


def _tell_of_objects(arena: Arena, mesh: trimesh.Trimesh, update: UpdateConfig) -> None:
    """Log which known objects stand where the surface has changed: they may have been moved or taken away."""
    if not arena.objects:
        return
    is_new, is_gone = find_changed_faces(arena.surface, mesh, update.digits)
    changed = np.concatenate([mesh.triangles[is_new], arena.surface.triangles[is_gone]]).reshape(-1, 3)
    for name, each in name_objects(arena.objects).items():
        corners = np.asarray(each.mesh.vertices) @ each.rotation.T + each.position
        low, high = corners.min(axis=0) - _NEAR_OBJECT, corners.max(axis=0) + _NEAR_OBJECT
        if ((changed >= low) & (changed <= high)).all(axis=1).any():
            logger.warning(
                "%s: %s stays where the surface has changed; find it again, it may have moved",
                arena.name,
                name,
            )


def _replace(
    arena: Arena,
    mesh: trimesh.Trimesh,
    scanned: ScannedSurface,
    contact: Contact,
    accuracy: float,
    notes: dict[str, Any],
    options: ContactOptions,
) -> Arena:
    """Return the arena with other pieces on another surface; everything else stays."""
    quality = add_scan_quality(contact.quality, scanned, contact.pieces, mesh)
    miss = find_miss(contact, accuracy, options.max_pieces, options.config.acceptance)
    about = {
        **{name: value for name, value in arena.provenance.items() if name not in ("worst", "passes", "cut")},
        "source": scanned.source,
        "num_faces": len(scanned.mesh.faces),
        "accuracy": accuracy,
        "is_reached": miss <= 1.0,
        **({"cut": scanned.cut} if scanned.cut else {}),
        "viewpoints": choose_positions(scanned.viewpoints),
        "update": {**notes, "built_again": ""},
    }
    return replace(arena, pieces=contact.pieces, surface=mesh, quality=quality, provenance=about)


def _build_again(
    arena: Arena,
    surface: Reconstruction | trimesh.Trimesh | str | Path,
    viewpoints: ArrayLike | None,
    options: ContactOptions,
    reason: str,
    notes: dict[str, Any],
    ground: GroundFriction,
    progress: Progress,
) -> Arena:
    """Return the arena with all contact geometry made again, and the reason in its notes."""
    logger.info("all contact geometry is made again: %s", reason)
    made = make_arena(
        surface,
        accuracy=options.accuracy,
        max_pieces=options.max_pieces,
        kind=options.kind,
        viewpoints=viewpoints,
        name=arena.name,
        friction=ground.friction,
        friction_map=ground.friction_map,
        thickness=options.thickness,
        seed=options.seed,
        time_limit=options.time_limit,
        config=options.config,
        progress=progress,
    )
    return replace(
        arena,
        pieces=made.pieces,
        surface=made.surface,
        quality=made.quality,
        kind=made.kind,
        height_field=made.height_field,
        friction=ground.friction,
        friction_source=ground.source,
        friction_map=ground.friction_map,
        provenance={**made.provenance, "update": {**notes, "built_again": reason}},
    )
