"""From a repaired surface to contact geometry: a few ways to make it, and one rule that accepts their candidates."""

import math
import time
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import format_distance
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.surfaces.intersections import find_intersections
from symbrion_gym._src.contact.boxing import drop_hidden, split_at_creases, turn_into_boxes
from symbrion_gym._src.contact.coacd import OutOfTimeError, decompose
from symbrion_gym._src.contact.distances import SurfaceDistance, find_nearest
from symbrion_gym._src.contact.kinds import (
    ACCEPTANCE_P95,
    UNCOVERED,
    Contact,
    ContactOptions,
    HeightField,
    make_height_field,
)
from symbrion_gym._src.contact.patches import thicken_patches
from symbrion_gym._src.contact.planes import find_planes, share_planes
from symbrion_gym._src.contact.reach import Reach
from symbrion_gym._src.contact.simplification import (
    GROWTH,
    Shape,
    close_holes,
    find_shape,
    is_drawn,
    list_counts,
    select_simple,
    simplify_surface,
    snap_to_planes,
    split_long_edges,
    take_top,
)
from symbrion_gym._src.contact.slabs import make_slabs
from symbrion_gym._src.errors import ArenaError

_AIM = 0.4
"""Patches aim at this share of the accuracy while they are few enough: beams that graze a wall feel a few
millimeters."""
_JOINING = 0.8  # Triangles are joined within this share of what patches aim at

_MOST_PLANES = 40  # A terrain of more planes is rough ground, for which slabs are no model
_HELD = 0.7  # Share of the ground that planes hold; of less, it is rough
_MAX_SLABS = 64  # No more slabs than these: beyond, patches follow the ground as well in less time
_MAX_BOXED = 24  # Of more slabs, none becomes a box: that compares every one with all others
_MAX_PARTS = 16  # Slabs are not cut at creases into more parts than these

_LEAST_DENSITY = 50.0  # Pieces over the area in plan, from which on a height field is looked for [1/m²]
_KNOWN = 0.98
"""Share of the grid within its rim that lies on the ground, at least: elsewhere a height field invents ground."""
_FIELD_SHARE = 0.3
"""Its mean distance is at most this share of the accuracy, the 95th percentile this share of what is good enough: a
beam that grazes the ground feels a few millimeters."""
_FIELD_SPACINGS = tuple(0.06 * 0.8**k for k in range(5))
"""Spacings of its grid that are tried [m]: from half a Scout on, down to 2.5 cm."""

_REACH = 0.05
"""The share without contact counts where the 95th percentile that is good enough is below this [m]: on a square
kilometer known to a meter, 5 cm say nothing."""
_MARGINS = {"mean": 0.1, "p95": 0.2, "protrusion_p95": 0.2}
"""A candidate as good as the best has distances larger by no more than these, in accuracies: what sampling and
the seams of boxes add."""
_SHARE_MARGIN = 5e-4  # Likewise for the share without contact
_MORE_PIECES = 1.5  # A candidate as good as the best has no more than this many times the pieces
_MORE_FEW = 3  # ... or this many more.
_MANY_PIECES = 64  # A candidate that is good enough replaces a better one of more pieces than these
_FEWER = 0.5  # ... if it has no more than this share of them: fewer pieces make faster contacts.
_BEYOND = 0.05  # Accuracy beyond reach [m]: what nothing touches stops beams about where it is
_BEYOND_SHARE = 0.25  # Of the pieces, so many are kept for what is beyond reach
_TOO_MANY = 1e9  # Too many pieces are worse than any distance: their number is a limit, the accuracy a wish


class ContactProblem:
    """One repaired surface, what is wanted, and what every pass needs to know of it."""

    def __init__(
        self,
        surface: trimesh.Trimesh,
        options: ContactOptions,
        accuracy: float,
        is_two_sided: Bool[np.ndarray, " F"] | None,
        zone: Reach | None = None,
    ) -> None:
        self.surface, self.options, self.accuracy = surface, options, accuracy
        self.aim = _AIM * accuracy  # distance that patches aim at [m]
        is_mixed = zone is not None and bool((zone.measure_excess(np.asarray(surface.vertices)) > 0).any())
        self.zone = zone if is_mixed else None  # what is within reach; None for all
        self.distance, self.ground = SurfaceDistance(surface, self.zone), Elevation(surface)
        self.shape: Shape = find_shape(surface, self.ground)
        self._is_two_sided = is_two_sided
        self.start = time.perf_counter()

    @cached_property
    def top(self) -> trimesh.Trimesh:
        """What of a terrain is ground or wall, cut finer where its faces are large."""
        return split_long_edges(take_top(self.surface))

    @cached_property
    def top_ground(self) -> Elevation:
        """Heights of the top of a terrain."""
        return Elevation(self.top)

    def is_seen_from_behind(self, places: Float[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return which places on the surface were seen from behind, too."""
        if self._is_two_sided is None or not self._is_two_sided.any():
            return np.zeros(len(places), dtype=bool)
        vertices, faces = np.asarray(self.surface.vertices), np.asarray(self.surface.faces)
        return self._is_two_sided[find_nearest(places, vertices, faces)[1]]

    def measure(self, contact: list[trimesh.Trimesh] | HeightField, way: str, **notes: Any) -> Contact:
        """Return contact geometry with its distances from the surface."""
        quality = self.distance.measure(contact, time.perf_counter() - self.start)
        if isinstance(contact, HeightField):
            return Contact([], quality, contact, {"way": way, **notes})
        return Contact(contact, quality, None, {"way": way, **notes})

    def compute_miss(self, contact: Contact) -> float:
        """Return how far contact misses what is wanted: the worst of its figures over the wanted one; 1 or less for
        nothing missed."""
        return compute_miss(contact, self.accuracy, self.options.max_pieces)


Pass = Callable[[ContactProblem, Contact | None], Contact | None]
"""From the problem and the best so far to a candidate; None where the pass does not apply."""


def make_contact(
    surface: trimesh.Trimesh,
    options: ContactOptions,
    accuracy: float,
    progress: Progress = silent,
    is_two_sided: Bool[np.ndarray, " F"] | None = None,
    zone: Reach | None = None,
) -> Contact:
    """Make contact geometry of a repaired surface; its quality is that within a zone, if there is one."""
    problem = ContactProblem(surface, options, accuracy, is_two_sided, zone)
    special: dict[str, tuple[Pass, ...]] = {"hfield": (make_field,), "prisms": (make_prisms,)}
    field = (fit_height_field,) if options.kind == "auto" else ()
    passes = special.get(options.kind, (fit_slabs, fit_patches, *field, decompose_body, fit_boxes))
    best, record = None, []
    for number, make in enumerate(passes):
        name = make.__name__.replace("_", " ")
        progress(name, 0.05 + 0.9 * number / len(passes))
        try:
            candidate = make(problem, best)
        except OutOfTimeError:
            raise  # another candidate in its place would depend on the speed of the machine
        except ArenaError as reason:
            record.append({"pass": name, "result": str(reason)})
            continue
        if candidate is None:
            continue
        fault = find_fault(best, candidate, accuracy, options.max_pieces)
        quality = candidate.quality
        figures = {"pieces": len(candidate.pieces), "mean": quality.mean, "uncovered": quality.uncovered}
        record.append({"pass": name, **figures, "result": f"refused: {fault}" if fault else "accepted"})
        best = best if fault else candidate
    if best is None:
        reasons = "".join(f"; {each['result']}" for each in record)
        raise ArenaError(
            f"no contact geometry can be made of this surface: it has no face that a robot could touch{reasons}"
        )
    return _add_notes(problem, best, record)


def fit_slabs(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return slabs beneath the planes of a terrain; None where it is no terrain, or too rough for planes."""
    if problem.shape != "terrain":
        return None
    top, options = problem.top, problem.options
    planes = find_planes(top, problem.accuracy)
    held = float(top.area_faces[planes.labels >= 0].sum() / top.area)
    if held < _HELD or not 0 < len(planes.normals) <= _MOST_PLANES:
        return None
    planes = share_planes(top, planes, problem.accuracy)
    most = min(options.max_pieces, _MAX_SLABS)
    pieces = make_slabs(top, problem.top_ground, planes, problem.accuracy, most)
    return (
        problem.measure(pieces, "slabs", planes=len(planes.normals), noise=planes.noise) if pieces else None
    )


def fit_patches(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return patches of the coarsest triangles that reach what is wanted with no more pieces than allowed.

    Flat parts of the surface are moved onto planes first. Coarser triangles are taken while there are too many pieces,
    finer ones while the distance is too large. What is beyond reach becomes few coarse ones. None where what is wanted
    is reached already.
    """
    if best is not None and problem.compute_miss(best) <= 1.0:
        return None
    planes = find_planes(problem.surface, problem.aim)
    flat, most = snap_to_planes(problem.surface, planes, problem.aim), problem.options.max_pieces
    zone, far = problem.zone, None
    most -= 0 if zone is None else int(_BEYOND_SHARE * most)
    counts = list_counts(len(flat.faces))
    index, step, made = select_simple(flat, problem.distance, problem.aim, is_drawn(problem.surface)), 0, None
    num_before = 0
    while index < len(counts):
        simple = simplify_surface(flat, counts[index])
        near = simple if zone is None else zone.take_near(simple)
        pieces = _thicken(problem, near, _JOINING * problem.aim)
        is_few = len(pieces) <= most
        if not is_few and index == 0:  # many parts: the largest are kept
            pieces = sorted(pieces, key=lambda piece: -piece.area)[:most]
        if pieces and (is_few or index == 0):
            notes = {"planes": len(planes.normals), "triangles": len(simple.faces)}
            found = problem.measure(pieces, "patches of planes and triangles", **notes)
            if made is None or problem.compute_miss(found) < problem.compute_miss(made):
                made, far = found, zone and zone.take_near(simple, beyond=True)
            if problem.compute_miss(found) <= 1.0:
                break
        wanted = 1 if is_few else -1
        if (step and wanted != step) or (index == 0 and not is_few):
            break
        step = wanted
        # As many steps of `list_counts` as divide the number of triangles by what is too much.
        fewer = 0 if is_few else max(math.ceil(math.log(len(pieces) / most) / math.log(GROWTH)), 1)
        if not is_few and len(simple.faces) == num_before:  # boundaries stay: there are no fewer triangles
            fewer = index
        num_before = len(simple.faces)
        index = index + 1 if is_few else max(index - fewer, 0)
    return _add_beyond(problem, made, far) if made and far and len(far.faces) else made


def _add_beyond(problem: ContactProblem, contact: Contact, far: trimesh.Trimesh) -> Contact:
    """Return patches within reach together with coarse ones of what is beyond."""
    aim, counts = _AIM * max(_BEYOND, problem.accuracy), list_counts(len(far.faces))
    distance = SurfaceDistance(far)
    enough = bisect_left(
        counts[:-1], -aim, key=lambda count: -distance.measure_mesh(simplify_surface(far, count)).mean()
    )
    simple = simplify_surface(far, counts[enough])
    most = problem.options.max_pieces - len(contact.pieces)
    pieces = sorted(_thicken(problem, simple, _JOINING * aim), key=lambda piece: -piece.area)[:most]
    return problem.measure([*contact.pieces, *pieces], **contact.notes, beyond_reach=len(pieces))


def make_prisms(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return one solid a triangle: exact, with all the noise, for comparison."""
    pieces = _thicken(problem, problem.surface, 0.0)
    return problem.measure(pieces, "prisms") if pieces else None


def _thicken(problem: ContactProblem, mesh: trimesh.Trimesh, tolerance: float) -> list[trimesh.Trimesh]:
    extent = float(problem.surface.extents.max())
    return thicken_patches(mesh, tolerance, extent, problem.is_seen_from_behind)


def make_field(problem: ContactProblem, best: Contact | None) -> Contact:
    """Return the heights of a terrain on a grid."""
    return problem.measure(make_height_field(problem.surface, problem.ground), "height field")


def fit_height_field(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return the coarsest height field that follows open ground of many patches closely; None where they are few.

    Heights off the ground are those of the nearest place on it. The outer rows do not count: the rim of a scan is
    ragged. Where patches miss what is wanted and no field follows so closely, it is that of the kind "hfield".
    """
    if best is None or problem.shape != "terrain" or problem.surface.is_watertight:
        return None
    is_missed = problem.compute_miss(best) > 1.0
    is_sparse = len(best.pieces) < _LEAST_DENSITY * float(np.prod(problem.surface.extents[:2]))
    if not is_missed and (is_sparse or best.notes["way"] == "slabs"):
        return None
    for spacing in _FIELD_SPACINGS:
        field = make_height_field(problem.surface, problem.ground, spacing)
        is_known = np.isfinite(problem.ground.height(*field.find_places()))
        if min(is_known.shape) < 3 or is_known[1:-1, 1:-1].mean() < _KNOWN:
            reason = "too much of the ground is not known for a height field"
            break
        nearest = np.asarray(distance_transform_edt(~is_known, return_distances=False, return_indices=True))
        made = problem.measure(
            field._replace(heights=field.heights[tuple(nearest)]), "height field", spacing=spacing
        )
        mean, p95 = made.quality.mean / problem.accuracy, made.quality.p95 / problem.accuracy
        if mean <= _FIELD_SHARE and p95 <= _FIELD_SHARE * ACCEPTANCE_P95:
            return made
    else:
        reason = "no grid follows the ground closely enough for a height field"
    if is_missed:
        return make_field(problem, best)
    raise ArenaError(reason)


def decompose_body(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return coacd's pieces of the closed solid that the surface bounds, small holes closed; None where it is open."""
    if problem.shape == "terrain":
        return None
    solid = close_holes(problem.surface)
    if not solid.is_watertight or solid.volume <= 0:
        return None
    if len(find_intersections(np.asarray(solid.vertices), np.asarray(solid.faces))):
        raise ArenaError("the solid runs through itself: coacd might never end")
    return problem.measure(decompose(solid, problem.options.seed), "coacd")


def fit_boxes(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return few slabs cut at creases and turned into boxes."""
    if best is None or best.notes["way"] != "slabs" or len(best.pieces) > _MAX_BOXED:
        return None
    most = min(problem.options.max_pieces, max(_MAX_PARTS, len(best.pieces)))
    boxed = turn_into_boxes(split_at_creases(best.pieces, most), problem.top_ground)
    return problem.measure(drop_hidden(boxed, problem.top_ground), **best.notes)


def compute_miss(contact: Contact, accuracy: float, max_pieces: int) -> float:
    """Return how far contact geometry misses what is wanted: the worst of its figures over the wanted one; 1 or less
    where nothing is missed.
    """
    if contact.height_field is None and not contact.pieces:
        return float("inf")
    if len(contact.pieces) > max_pieces:
        return _TOO_MANY * len(contact.pieces) / max_pieces
    quality = contact.quality
    figures = [quality.mean / accuracy, quality.p95 / (ACCEPTANCE_P95 * accuracy)]
    if ACCEPTANCE_P95 * accuracy < _REACH:
        figures.append(quality.uncovered / UNCOVERED)
    return max(figures)


def find_fault(best: Contact | None, candidate: Contact, accuracy: float, max_pieces: int) -> str:
    """Return why a candidate does not replace the best so far; nothing where it does.

    While the best misses what is wanted, a candidate that misses it by less replaces it. Then it must be as good, or
    good enough with far fewer pieces.
    """
    if best is None:
        return ""
    miss, kept_miss = (compute_miss(contact, accuracy, max_pieces) for contact in (candidate, best))
    if miss > 1.0 or kept_miss > 1.0:
        return "" if miss < kept_miss else f"misses what is wanted {miss:.3g}-fold against {kept_miss:.3g}"
    kept_count, count = len(best.pieces), len(candidate.pieces)
    if kept_count > _MANY_PIECES and count <= _FEWER * kept_count:
        return ""
    if count > max(int(_MORE_PIECES * kept_count), kept_count + _MORE_FEW):
        return f"{count} pieces for {kept_count}"
    margins = {name: margin * accuracy for name, margin in _MARGINS.items()} | {"uncovered": _SHARE_MARGIN}
    for name, margin in margins.items():
        got, kept = getattr(candidate.quality, name) or 0.0, getattr(best.quality, name) or 0.0
        if got > kept + margin:
            return f"{name} {got:.3g} against {kept:.3g}"
    return ""


def _add_notes(problem: ContactProblem, contact: Contact, record: list) -> Contact:
    """Return contact geometry with what a user should know of it, and the time that it has taken."""
    options, quality, count = problem.options, contact.quality, len(contact.pieces)
    is_reached = problem.compute_miss(contact) <= 1.0
    found = problem.distance.compute_gaps(contact.height_field or contact.pieces).find_worst()
    place, distance = [round(float(x), 3) for x in found[0]], found[1]
    notes: dict[str, Any] = {"accuracy": problem.accuracy, "shape": problem.shape, "is_reached": is_reached}
    notes |= {"passes": record, "worst": {"place": place, "distance": distance}, "warnings": []}
    if not is_reached:
        remedy = "ask for less accuracy"
        if options.kind in ("hfield", "prisms"):
            remedy = "take --kind convex"
        elif 2 * count >= options.max_pieces:
            remedy = f"allow more pieces: --max-pieces {2 * options.max_pieces}"
        elif problem.shape == "terrain" and options.kind != "auto":  # which has tried it
            remedy = "take --kind hfield"
        notes["remedy"] = remedy
        notes["warnings"].append(
            f"accuracy {format_distance(problem.accuracy)} was missed: {count} pieces are "
            f"{format_distance(quality.mean)} off in the mean, {format_distance(quality.p95)} at the 95th percentile, "
            f"{quality.uncovered:.1%} of the surface has no contact within 5 cm; worst {format_distance(distance)} at "
            f"({', '.join(f'{x:.2f}' for x in place)}); {remedy}"
        )
    quality = replace(quality, seconds=time.perf_counter() - problem.start)
    return replace(contact, quality=quality, notes={**contact.notes, **notes})
