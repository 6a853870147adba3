"""The scanned arenas that ship hold nothing of the true course; everything about it is found on their surface."""

import json
import re
from dataclasses import fields
from pathlib import Path

import pytest
import trimesh
from scipy.spatial import cKDTree

from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.assets import SCANNED, find_assets
from symbrion_gym._src.errors import ArenaError

SCANS = [(name, Course().pit) for name in SCANNED]
WORDS = {"course", "truth", "true", "start", "goal", "finish", "edge", "edges", "stairs"}
WORDS |= {field.name for kind in (Course, StairsCourse) for field in fields(kind)} - {"friction"}
WORDS |= {name for name in vars(Course) if isinstance(vars(Course)[name], property)}
_SAME = 2e-4
"""Vertices are saved to 0.1 mm."""


def find_folder(name: str) -> Path:
    return find_assets() / "arenas" / name


def list_entries(content, path=()):
    """Yield path and value of everything in JSON content."""
    if isinstance(content, dict):
        for name, value in content.items():
            yield from list_entries(value, (*path, name))
    elif isinstance(content, list):
        for value in content:
            yield from list_entries(value, path)
    else:
        yield path, content


def find_truths(course: Course) -> set[float]:
    """Return the numbers of a course."""
    numbers = {getattr(course, field.name) for field in fields(course)} - {course.friction}
    for derived in (course.pit_edges, course.ramp_feet, course.start, course.goal, (course.length,)):
        numbers |= set(derived)
    return numbers


@pytest.mark.parametrize(("name", "pit"), SCANS)
def test_a_scanned_arena_holds_nothing_of_the_truth(name, pit):
    about = json.loads((find_folder(name) / "arena.json").read_text())
    numbers = find_truths(Course(pit=pit)) - {0.0}
    for path, value in list_entries(about):
        words = set(re.split(r"[^a-z]+", " ".join(path).lower().replace("_", " ")))
        assert not words & WORDS, f"{path} names what only the truth knows"
        if isinstance(value, str):
            assert not set(re.split(r"[^a-z]+", value.lower())) & WORDS, f"{path} is {value!r}"
            assert str(pit) not in value, f"{path} is {value!r}"
        elif isinstance(value, float) and path[:2] != ("provenance", "options"):
            assert value not in numbers, f"{path} is {value}, a number of the course"
    model = (find_folder(name) / "arena.xml").read_text().lower()
    assert not set(re.split(r"[^a-z]+", model)) & {"course", "truth", "pit", "ramp", "plateau"}


@pytest.mark.parametrize(("name", "pit"), SCANS)
def test_no_corner_of_the_truth_is_in_the_meshes(name, pit):
    corners = cKDTree(Course(pit=pit).surface().vertices)
    for path in sorted(find_folder(name).rglob("*.obj")):
        vertices = trimesh.load(path, process=False).vertices
        assert corners.query(vertices)[0].min() > _SAME, path


@pytest.mark.parametrize(
    ("name", "course"), [("stairs", None), ("truth", Course()), ("gsrm", None), ("some.ply", None)]
)
def test_only_arenas_made_in_code_have_a_pit_of_choice(name, course):
    assert load_arena("truth", pit=0.3).course == Course(pit=0.3)
    with pytest.raises(ArenaError, match=r"pit of 0\.3 is an option of"):
        load_arena(name, course, 0.3)
