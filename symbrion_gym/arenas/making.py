"""Arenas made of surfaces."""

from __future__ import annotations

from pathlib import Path

import trimesh

from reconstruction.errors import ReconstructionError
from reconstruction.files.printable import make_printable
from reconstruction.geometry.mesh_repair import repair_mesh
from reconstruction.progress import Progress, silent
from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.cache import find_versions, get_or_make
from symbrion_gym.arenas.course import Course, StairsCourse
from symbrion_gym.arenas.surface_file import load_surface
from symbrion_gym.contact.builder import make_contact
from symbrion_gym.contact.contact import Contact
from symbrion_gym.contact.options import ContactOptions, ContactTuning
from symbrion_gym.errors import ArenaError


def make_arena(
    mesh: trimesh.Trimesh | str | Path,
    *,
    accuracy: float = 0.003,
    max_pieces: int = 64,
    kind: str = "convex",
    course: Course | StairsCourse | None = None,
    name: str | None = None,
    friction: float | None = None,
    thickness: float = 0.2,
    seed: int = 0,
    time_limit: float = 120.0,
    cache: bool | str | Path = True,
    tuning: ContactTuning | None = None,
    progress: Progress = silent,
) -> Arena:
    """Make an arena of a surface: convex pieces for contact that follow it, and the surface itself for rays.

    Planes found in a terrain make convex slabs, their union a closed solid, coacd of that the pieces; where these
    are worse than the slabs, the slabs are kept. Any other shape goes to coacd as it is. `Arena.quality` says what
    was reached, `Arena.provenance` how, and why so.

    Args:
        mesh: a terrain open at its rim, or any other surface or body, or a file of it; meters, z up.
        accuracy: distance between pieces and surface that is good enough [m].
        max_pieces: no more convex pieces than these, where that can be had.
        kind: contact geometry, one of "convex", "primitives", "hfield", "prisms".
        course: the course that was scanned, where it is known: its pit edges, start and goal are kept.
        name: what to call it; the file's name unless given.
        friction: sliding friction; the course's, or 0.7, unless given.
        thickness: how far pieces reach below the lowest ground [m].
        seed: seed of coacd's search.
        time_limit: building ends by then, with what there is or an error [s].
        cache: whether to keep pieces in the user's cache, or the folder to keep them in.
        tuning: everything else that shapes the pieces.
        progress: called with what is being done and the share done.

    Raises:
        ArenaError: the mesh cannot be used, or an option is out of range.
    """
    tuning = tuning or ContactTuning()
    options = ContactOptions(accuracy, max_pieces, kind, thickness, seed, time_limit, tuning)
    source = "mesh"
    if not isinstance(mesh, trimesh.Trimesh):
        source = make_printable(Path(mesh).name)
        name = name or make_printable(Path(mesh).stem)
        mesh = load_surface(mesh)
    progress("repairing the mesh", 0.0)
    num_faces = len(mesh.faces)
    try:
        mesh = repair_mesh(mesh, tuning.repair)
    except ReconstructionError as error:
        raise ArenaError(f"{source}: {error}") from error

    def make() -> Contact:
        return make_contact(mesh, options, progress)

    folder = Path(cache) if isinstance(cache, str | Path) else None
    contact = make() if cache is False else get_or_make(mesh, options, make, folder)
    progress("done", 1.0)
    if friction is None:
        friction = course.friction if course is not None else 0.7
    about = {
        "source": source,
        "num_faces": num_faces,
        "options": options.as_dict(),
        "versions": find_versions(),
        **contact.notes,
    }
    return Arena(
        name or "arena",
        contact.pieces,
        mesh,
        contact.quality,
        friction,
        course,
        kind,
        contact.height_field,
        about,
    )
