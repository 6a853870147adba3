"""From a repaired surface to contact geometry that meets an accuracy within a time."""

from __future__ import annotations

import logging
from dataclasses import replace

import trimesh

from reconstruction.geometry.elevation import Elevation
from reconstruction.progress import Progress, silent
from symbrion_gym.contact.budget import TimeBudget
from symbrion_gym.contact.coacd_search import decompose_solid
from symbrion_gym.contact.contact import Contact
from symbrion_gym.contact.job import ContactJob
from symbrion_gym.contact.kinds import make_height_field, make_prisms
from symbrion_gym.contact.options import ContactOptions
from symbrion_gym.contact.solid import close_holes, find_shape, take_top, thicken
from symbrion_gym.contact.subdivision import split_long_edges
from symbrion_gym.contact.surface_error import BodyErrorMetric, TerrainErrorMetric
from symbrion_gym.contact.terrain import follow_terrain

_logger = logging.getLogger(__name__)


def make_contact(mesh: trimesh.Trimesh, options: ContactOptions, progress: Progress = silent) -> Contact:
    """Make contact geometry of a repaired surface; the notes say where other work on the machine cut it short.

    Raises:
        ArenaError: no geometry of this kind can be made of this surface in time.
    """
    budget = TimeBudget(options.time_limit)
    contact = _make_contact(mesh, options, budget, progress)
    if not budget.is_disturbed:
        return contact
    _logger.warning(
        "the machine was busy for %.0f of %.0f s: the pieces may be more, or looser, than they could be; "
        "build the arena again when it is free",
        budget.elapsed - budget.spent,
        budget.elapsed,
    )
    return replace(contact, notes={**contact.notes, "was_disturbed": True})


def _make_contact(
    mesh: trimesh.Trimesh, options: ContactOptions, budget: TimeBudget, progress: Progress
) -> Contact:
    tuning, ground = options.tuning, Elevation(mesh)
    if options.kind in ("prisms", "hfield"):
        metric = TerrainErrorMetric(mesh, ground)
        if options.kind == "prisms":
            return ContactJob(options, metric, budget, progress).measure(make_prisms(mesh), {"way": "prisms"})
        heights = make_height_field(mesh, ground)
        quality = metric.measure([heights.as_mesh()], budget.elapsed)
        return Contact([], quality, heights, {"way": "height field"})
    shape = find_shape(mesh, ground, tuning.shapes)
    body = close_holes(mesh, tuning.shapes) if shape == "overhang" else mesh
    if body is not mesh and body.is_watertight:
        shape = "closed"
    progress(f"the surface is a {shape}", 0.05)
    if shape == "terrain":
        job = ContactJob(options, TerrainErrorMetric(mesh, ground), budget, progress)
        return follow_terrain(job, split_long_edges(take_top(mesh, tuning.shapes), tuning.subdivision))
    thickness = min(options.thickness, tuning.search.max_thickness * float(mesh.extents.max()))
    solid = body if shape == "closed" else thicken(mesh, thickness)
    return decompose_solid(ContactJob(options, BodyErrorMetric(mesh), budget, progress), solid, shape)
