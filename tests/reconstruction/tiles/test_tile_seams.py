"""Seams of tiles: cut exactly, moved onto the mean, with the same vertices on both sides."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.tiles.point_stream import TilesConfig
from reconstruction._src.tiles.seams import Surface, clip, join_tile

CONFIG = TilesConfig(tile=10.0, halo=2.0)


def make_sheet(place: tuple[int, int], height, seed: int = 0, spacing: float = 1.3) -> Surface:
    """Return a sheet over a tile and its halo: a grid of its own, shaken in plan."""
    from scipy.spatial import Delaunay

    low = np.array(place) * CONFIG.tile - CONFIG.width
    side = np.arange(0.0, CONFIG.tile + 2 * CONFIG.width + spacing, spacing)
    plan = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) + low
    plan += np.random.default_rng([seed, *(number % 8 for number in place)]).uniform(-0.3, 0.3, plan.shape)
    faces = Delaunay(plan).simplices.astype(np.int64)
    return Surface(np.c_[plan, height(plan[:, 0], plan[:, 1])], faces)


def join(place, sheets) -> Surface:
    neighbors = {
        (x, y): sheets[place[0] + x, place[1] + y]
        for x in (-1, 0, 1)
        for y in (-1, 0, 1)
        if (x, y) != (0, 0) and (place[0] + x, place[1] + y) in sheets
    }
    return join_tile(sheets[place], neighbors, place, CONFIG)


def find_seam(surface: Surface, axis: int, value: float) -> np.ndarray:
    rows = surface.vertices[surface.vertices[:, axis] == value]
    return rows[np.argsort(rows[:, 1 - axis])]


def find_area(surface: Surface) -> float:
    corners = surface.vertices[surface.faces][:, :, :2]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return float(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2)


def test_a_cut_is_exact() -> None:
    cut = clip(make_sheet((0, 0), lambda x, y: 0.1 * x), (0, 0), 10.0)
    assert find_area(cut) == pytest.approx(100.0)
    assert cut.vertices[:, :2].min() == 0.0
    assert cut.vertices[:, :2].max() == 10.0
    assert np.allclose(cut.vertices[:, 2], 0.1 * cut.vertices[:, 0])
    a, b = (cut.vertices[cut.faces[:, i]] - cut.vertices[cut.faces[:, 0]] for i in (1, 2))
    assert (np.cross(a, b)[:, 2] > 0).all(), "the winding stays"


def test_a_plane_stays_a_plane() -> None:
    sheets = {(i, 0): make_sheet((i, 0), lambda x, y: 0.2 * x - 0.1 * y, seed=i) for i in (0, 1)}
    for place in sheets:
        joined = join(place, sheets).vertices
        assert np.allclose(joined[:, 2], 0.2 * joined[:, 0] - 0.1 * joined[:, 1], atol=1e-9)


def test_a_step_becomes_the_mean_and_both_sides_meet() -> None:
    sheets = {
        (0, 0): make_sheet((0, 0), lambda x, y: 0 * x),
        (1, 0): make_sheet((1, 0), lambda x, y: 0 * x + 0.1),
    }
    left, right = (join(place, sheets) for place in sheets)
    for seam in (find_seam(left, 0, 10.0), find_seam(right, 0, 10.0)):
        assert np.allclose(seam[:, 2], 0.05)
    assert np.array_equal(find_seam(left, 0, 10.0), find_seam(right, 0, 10.0)), (
        "the same vertices, to the bit"
    )
    # Inside, beyond the halo, nothing has moved, and in between it rises steadily.
    x, z = left.vertices[:, 0], left.vertices[:, 2]
    assert np.allclose(z[x < 8.0], 0.0)
    assert np.allclose(z, 0.1 * np.clip((x - 8) / 2, 0, 1) / (1 + np.clip((x - 8) / 2, 0, 1)), atol=1e-9)


def test_four_rough_tiles_have_no_step() -> None:
    def make_height(seed):
        rng = np.random.default_rng(seed)
        return lambda x, y: 0.5 * np.sin(x / 3) * np.cos(y / 4) + rng.normal(0, 0.03, len(x))

    sheets = {(i, j): make_sheet((i, j), make_height(2 * i + j), seed=7) for i in (0, 1) for j in (0, 1)}
    joined = {place: join(place, sheets) for place in sheets}
    corners = [surface.vertices[(surface.vertices[:, :2] == 10.0).all(axis=1)] for surface in joined.values()]
    assert all(len(corner) == 1 for corner in corners)
    assert len({corner.tobytes() for corner in corners}) == 1
    import trimesh

    elevation = Elevation(*(trimesh.Trimesh(*surface, process=False) for surface in joined.values()))
    raw = Elevation(*(trimesh.Trimesh(*clip(sheets[p], p, 10.0), process=False) for p in sheets))
    along = np.linspace(0.1, 19.9, 2000)
    steps = {
        name: np.abs(
            ground.height(np.full(2000, 10 - 1e-7), along) - ground.height(np.full(2000, 10 + 1e-7), along)
        )
        for name, ground in (("raw", raw), ("joined", elevation))
    }
    assert np.percentile(steps["raw"], 90) > 0.03
    assert steps["joined"].max() < 1e-5


def test_different_surfaces_are_not_joined() -> None:
    """A roof 3 m above the ground is no step of 3 m."""
    sheets = {
        (0, 0): make_sheet((0, 0), lambda x, y: 0 * x),
        (1, 0): make_sheet((1, 0), lambda x, y: 0 * x + 3),
    }
    assert np.allclose(join((0, 0), sheets).vertices[:, 2], 0.0)
    assert np.allclose(join((1, 0), sheets).vertices[:, 2], 3.0)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("tile", 0.0, "tile is 0.0; a number above 0"),
        ("halo", 30.0, "halo is 30.0; above 0 and up to half"),
        ("units_per_area", -1.0, "units_per_area is -1.0"),
    ],
)
def test_impossible_divisions_are_refused(field, value, message) -> None:
    with pytest.raises(ReconstructionError, match=message):
        TilesConfig(**{field: value})
