"""Whether a robot can use an arena, in one word, with the figures that decide it and what helps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from reconstruction._src.base.range_checks import format_distance, format_share
from reconstruction._src.geometry.orientation import find_doubtful_axis, hangs_from_floor
from reconstruction._src.geometry.rows import compute_area_vectors
from reconstruction._src.geometry.sampling import sample_area
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality, RayMesh
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.footprint import SLOPE_LIMIT

ANSWERS = ("yes", "in part", "no")
ROBOT = ScoutConfig.size[0]  # The robot that a verdict is about: a Scout [m]
_HELD = 0.02  # Contact this near above or below the surface holds a robot there [m]
_NUM_SAMPLES = 4000  # Samples of the ground: a share of 2 % is known to 0.2 %
_OFF = 1e-3  # What is above ground is looked for from this far above it [m]
_ABOVE = 0.05  # Ground is looked for from this far above the surface [m]

# Limits beyond which a figure says "in part", and beyond which it says "no".
_LOOSE = 0.02, 0.15  # Share of the seen level ground without contact that holds
_UNCOVERED = 0.05, 0.35  # Share of all surface without contact within 5 cm
_BEAMS = 0.1, 0.5  # Share of the beams that end right on the surface and elsewhere on contact
_UNSEEN = 0.1, 1.1  # Share of the level ground that nobody saw
_READINGS = ROBOT / 5, ROBOT / 2  # Median distance of the readings of level ground from the surface [m]
_LEAST_AREA = 100 * ROBOT**2, 10 * ROBOT**2  # Largest area to drive on [m²]


@dataclass(frozen=True)
class Reason:
    """A figure that is not good enough."""

    figure: str  # its name
    value: float  # a share of 1, a length [m] or an area [m²]
    answer: str  # "in part" or "no", as it alone would decide
    meaning: str  # the figure in a sentence
    remedy: str  # what helps, in words of the command line


@dataclass(frozen=True)
class Verdict:
    """Whether an arena is good for a Scout.

    Attributes:
        answer: "yes", "in part" (where the robot can drive, the map shows: `symbrion view`) or "no".
        reasons: why it is not "yes", those that say "no" first; none for "yes".
    """

    answer: str
    reasons: tuple[Reason, ...] = ()

    def __str__(self) -> str:
        """Return the verdict as one line."""
        why = "; ".join(f"{each.meaning} ({each.remedy})" for each in self.reasons)
        return f"good for a robot of {ROBOT:g} m: {self.answer}{why and f', because {why}'}"


def find_verdict(
    surface: trimesh.Trimesh,
    seen: trimesh.Trimesh,
    contact: Sequence[trimesh.Trimesh] | HeightField,
    quality: ArenaQuality,
    ground: TraversabilityMap | None,
    up: str | None = None,
    remedy: str = "",
) -> Verdict:
    """Return the verdict about an arena.

    Args:
        surface: all of its surface.
        seen: the part of it that readings confirm.
        contact: pieces, or a height field.
        quality: distances and shares that were measured when it was made.
        ground: where a Scout can drive; None where there is no ground.
        up: the axis of the file that points up, where it or the user says so.
        remedy: what contact that misses its accuracy needs.
    """
    better = remedy or "symbrion arena with a smaller --accuracy"
    figures = list(_judge_up(surface, up)) or [  # where that is wrong, the rest says nothing
        *_judge_area(ground, up),
        *_judge_ground(seen, contact, better),
        *_judge_contact(quality, better),
        *_judge_unseen(surface, seen),
    ]
    reasons = sorted(figures, key=lambda each: -ANSWERS.index(each.answer))
    return Verdict(reasons[0].answer if reasons else ANSWERS[0], tuple(reasons))


def _weigh(
    figure: str, value: float, limits: tuple[float, float], meaning: str, remedy: str
) -> Iterator[Reason]:
    """Yield a figure that is beyond its limits, which rise, or fall where less is worse."""
    sign = 1.0 if limits[0] < limits[1] else -1.0
    answer = ANSWERS[sum(sign * value > sign * limit for limit in limits)]
    if answer != ANSWERS[0]:
        yield Reason(figure, value, answer, meaning, remedy)


def _judge_up(surface: trimesh.Trimesh, up: str | None) -> Iterator[Reason]:
    """Yield a doubt about the axis that points up; a closed body is as its file winds it."""
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    axis = find_doubtful_axis(compute_area_vectors(vertices, faces)) if up is None else None
    if axis is not None:
        remedy = (
            f"give --up {axis.name} or --up -{axis.name}, or --up z if it is z; turn a tilted scan before"
        )
        yield Reason("up_axis", 1.0, "no", axis.doubt, remedy)
    elif not surface.is_watertight and hangs_from_floor(vertices, faces):
        meaning = "walls hang below its floor and hardly any stand on it: it is upside down, or a ceiling from outside"
        opposite = up[1:] if up and up[0] == "-" else f"-{up or 'z'}"
        remedy = f"give --up {opposite}, or where the scanner stood by --viewpoint"
        yield Reason("up_axis", 1.0, "no", meaning, remedy)


def _judge_area(ground: TraversabilityMap | None, up: str | None) -> Iterator[Reason]:
    """Yield that there is too little ground to drive on, or how roughly it is known."""
    area = 0.0 if ground is None or not ground.num_regions else float(ground.region_areas[0])
    meaning = f"the largest area to drive on has {area:.2g} m²"
    if not area and ground is not None and len(ground.cell):
        wide, needed = (2 * each for each in (ground.wall_distance.max(), ground.footprint.reach))
        meaning += (
            f": level ground is {wide:.2f} m wide at most between walls and rims, of {needed:.2f} m needed"
        )
    remedy = "symbrion view shows it; scan more ground"
    if not area and up is None:
        remedy += ", or say by --up which axis points up"
    yield from _weigh("drivable_area", area, _LEAST_AREA, meaning, remedy)
    if ground is not None and ground.grid.cell > ROBOT:
        meaning = f"its map has cells of {format_distance(ground.grid.cell)}, wider than the robot"
        remedy = "--unit if it is not in meters, --crop a part, or symbrion reconstruct --tile"
        yield Reason("cell", ground.grid.cell, "no", meaning, remedy)


def _judge_ground(
    seen: trimesh.Trimesh, contact: Sequence[trimesh.Trimesh] | HeightField, remedy: str
) -> Iterator[Reason]:
    """Yield how much of the ground has contact that does not hold a robot there."""
    level = _select_level(seen)
    if not len(level.faces):
        return
    points = sample_area(np.asarray(level.vertices), np.asarray(level.faces), _NUM_SAMPLES)
    rise = np.array([0.0, 0.0, 1.0])
    rays = RayMesh([contact.as_mesh()] if isinstance(contact, HeightField) else contact)
    ends = rays.cast(points + _ABOVE * rise, np.tile(-rise, (len(points), 1)))
    heights = RayMesh([seen]).cast(points + _OFF * rise, np.tile(rise, (len(points), 1)))
    is_loose = (np.abs(ends - _ABOVE) > _HELD) & (heights > ROBOT)  # in a lower gap no robot stands
    loose = float(is_loose.mean())
    meaning = f"{format_share(loose)} of the level ground has no contact within 2 cm"
    yield from _weigh("loose_ground", loose, _LOOSE, meaning, remedy)


def _judge_contact(quality: ArenaQuality, remedy: str) -> Iterator[Reason]:
    """Yield what is wrong with surface and contact: off the readings, not there, or in the way of the beams."""
    if quality.readings is not None:
        off = format_distance(quality.readings)
        meaning = f"half of the readings of level ground lie {off} or more off the surface"
        yield from _weigh(
            "readings", quality.readings, _READINGS, meaning, "scan from nearer or more densely, or --crop"
        )
    meaning = f"{format_share(quality.uncovered)} of the surface has no contact within 5 cm"
    yield from _weigh("uncovered", quality.uncovered, _UNCOVERED, meaning, remedy)
    if quality.beams_contact is not None and quality.beams_surface:
        lost = max(1.0 - quality.beams_contact / quality.beams_surface, 0.0)
        meaning = f"contact stops {format_share(lost)} of the laser beams elsewhere than the surface does"
        yield from _weigh("beams", lost, _BEAMS, meaning, f"check --viewpoint; {remedy}")


def _judge_unseen(surface: trimesh.Trimesh, seen: trimesh.Trimesh) -> Iterator[Reason]:
    """Yield how much of the level ground nobody saw."""
    whole = float(_select_level(surface).area)
    unseen = 1.0 - float(_select_level(seen).area) / whole if whole else 0.0
    meaning = f"{format_share(unseen)} of the level ground was not seen"
    yield from _weigh(
        "unseen_ground", unseen, _UNSEEN, meaning, "scan from more places or more densely, or --crop"
    )


def _select_level(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the faces that look up and are no steeper than a Scout climbs."""
    is_level = mesh.face_normals[:, 2] > np.cos(SLOPE_LIMIT) if len(mesh.faces) else np.zeros(0, dtype=bool)
    return trimesh.Trimesh(mesh.vertices, mesh.faces[is_level], process=False)
