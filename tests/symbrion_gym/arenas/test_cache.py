"""Cache entries: whatever is wrong with one, it is made again."""

import multiprocessing
from pathlib import Path

import numpy as np
import pytest
import trimesh
from damage import flip_bits
from scanned_surface import make_scanned_surface

import symbrion_gym as sg
from symbrion_gym._src.arenas.cache import read_entry, write_entry
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.contact.kinds import Contact, HeightField
from symbrion_gym._src.contact.quality import ArenaQuality

BOX = trimesh.creation.box((1.0, 2.0, 0.1))


def make_entry() -> Contact:
    field = HeightField(np.linspace(0, 1, 12).reshape(3, 4), np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    return Contact([BOX, BOX.copy()], ArenaQuality(0.001, 0.002, 0.003, 2), field, {"kind": "convex"})


def is_equal(one: Contact, other: Contact) -> bool:
    assert one.height_field is not None
    assert other.height_field is not None
    return (
        (one.quality, one.notes) == (other.quality, other.notes)
        and all(map(np.array_equal, one.height_field, other.height_field))
        and all(
            np.array_equal(a.triangles, b.triangles) for a, b in zip(one.pieces, other.pieces, strict=True)
        )
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_entry(tmp_path / "entry.npz", make_entry())
    return tmp_path / "entry.npz"


@pytest.mark.slow
def test_a_flipped_bit_gives_the_same_contact_or_none(path: Path, caplog) -> None:
    num_refused = 0
    for damaged in flip_bits(path.read_bytes(), 800):
        path.write_bytes(damaged)
        caplog.clear()
        found = read_entry(path)
        if found is None:
            num_refused += 1
            assert f"{path} cannot be used" in caplog.text
            assert "it is made again" in caplog.text
        else:
            assert is_equal(found, make_entry())
    assert num_refused > 300


def test_an_arena_comes_from_the_cache_and_a_damaged_entry_is_made_again(tmp_path: Path) -> None:
    first, again = (sg.make_arena(BOX, cache=tmp_path) for _ in range(2))
    (entry,) = tmp_path.glob("*.npz")
    entry.write_bytes(entry.read_bytes()[:500])
    for other in (again, sg.make_arena(BOX, cache=tmp_path)):
        assert other.quality.mean == first.quality.mean
        assert all(
            np.array_equal(a.vertices, b.vertices) for a, b in zip(first.pieces, other.pieces, strict=True)
        )
    sg.make_arena(BOX, cache=tmp_path, kind="hfield")
    assert len(list(tmp_path.glob("*.npz"))) == 2


def test_other_code_has_entries_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sg.make_arena(BOX, cache=tmp_path)
    monkeypatch.setattr("symbrion_gym._src.arenas.cache._hash_code", lambda: "another version")
    sg.make_arena(BOX, cache=tmp_path)
    assert len(list(tmp_path.glob("*.npz"))) == 2


def build_in_process(folder, queue):
    arena = make_arena(make_scanned_surface(Course().profile(), num_vertices=600), cache=folder)
    queue.put([piece.vertices.tobytes() for piece in arena.pieces])


@pytest.mark.slow
def test_two_processes_may_build_the_same_arena_at_once(tmp_path):
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    workers = [context.Process(target=build_in_process, args=(tmp_path, queue)) for _ in range(2)]
    for worker in workers:
        worker.start()
    first, second = (queue.get(timeout=300) for _ in workers)
    for worker in workers:
        worker.join()
    assert first == second
    assert len(list(tmp_path.glob("*.npz"))) == 1
