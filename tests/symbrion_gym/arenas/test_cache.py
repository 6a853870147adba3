"""Cache entries: whatever is wrong with one, it is made again."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from damage import flip_bits

from symbrion_gym._src.arenas.cache import get_or_make, read_entry, write_entry
from symbrion_gym._src.contact.kinds import Contact, ContactOptions, HeightField
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


def change(path: Path, **changes: np.ndarray) -> None:
    """Write an entry again with other arrays: a sound archive of something else."""
    with np.load(path) as file:
        np.savez_compressed(path, **(dict(file) | changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"field_low": np.array([-1.0, -0.5])},
        {"num_faces": np.array([10, 14])},
        {"about": np.array("[" * 100_000)},
        {"digest": np.array("")},
        {"another": np.zeros(1)},
    ],
)
def test_content_that_is_not_what_was_written_is_refused(path: Path, changes: dict, caplog) -> None:
    assert read_entry(path) is not None
    change(path, **changes)
    assert read_entry(path) is None
    assert "not what was written" in caplog.text


def test_a_damaged_entry_is_made_again_once(tmp_path: Path) -> None:
    made = []

    def make() -> Contact:
        made.append(make_entry())
        return made[-1]

    for damage in (None, b"", b"PK", bytes(500), None):
        for entry in tmp_path.glob("*.npz"):
            if damage is not None:
                entry.write_bytes(damage)
        assert is_equal(get_or_make(BOX, ContactOptions(), make, tmp_path), make_entry())
    assert len(made) == 4
