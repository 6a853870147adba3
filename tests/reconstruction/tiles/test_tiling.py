"""A large scan in tiles, end to end on a small landscape whose heights are known."""

import json
import logging

import numpy as np
import pytest

import reconstruction as rc
from benchmarks.large_scans import measure_surface
from benchmarks.material.landscape import make_landscape, sample_scan
from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.surfaces.color import find_vertex_colors
from reconstruction._src.tiles import tiling
from reconstruction._src.tiles.folder import INDEX, TiledSurface, read_surface
from reconstruction._src.tiles.point_stream import TilesConfig
from reconstruction._src.tiles.tiling import reconstruct_tile, reconstruct_tiles
from reconstruction._src.tiles.workers import run_here, run_in_processes

EXTENT, NOISE = 20.0, 0.01
CONFIG = TilesConfig(tile=10.0, halo=2.0, units_per_area=2.0)
LANDSCAPE = make_landscape(EXTENT, 0.5, 0.4, roughness=3.0)
FAR = np.array([5e6, 4e5, 0.0])


def make_points(count: int = 16_000) -> np.ndarray:
    return sample_scan(LANDSCAPE, count, NOISE, np.random.default_rng(0))


@pytest.fixture(scope="module")
def tiles(tmp_path_factory) -> TiledSurface:
    folder = tmp_path_factory.mktemp("scan")
    np.save(folder / "points.npy", make_points())
    return reconstruct_tiles(folder / "points.npy", folder / "tiles", CONFIG)


def read_all(folder) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.slow
def test_the_surface_is_near_the_truth_and_has_no_steps(tiles):
    figures = measure_surface(tiles, LANDSCAPE)
    assert figures["error_mean"] < 2 * NOISE
    assert figures["error_at_seams_mean"] < 2 * NOISE
    assert figures["step_max"] < NOISE / 100


@pytest.mark.slow
def test_the_index_describes_the_tiles(tiles):
    index = json.loads((tiles.folder / INDEX).read_text())
    assert index["points"] == sum(entry["points"] for entry in index["tiles"]) == 16_000
    assert index["points_without_surface"] == 0
    assert index["complete"] is True
    assert tiles.places == ((0, 0), (0, 1), (1, 0), (1, 1))
    assert sorted(read_all(tiles.folder)) == [f"tile_{x}_{y}.npz" for x in (0, 1) for y in (0, 1)] + [INDEX]
    assert not [path for path in tiles.folder.iterdir() if path.is_dir()], "the working folder is removed"


def test_tiles_around_a_place_are_chosen(tiles):
    assert tiles.find_places((1.0, 1.0), 2.0) == [(0, 0)]
    assert tiles.find_places((9.0, 1.0, 5.0), 2.0) == [(0, 0), (1, 0)]
    assert len(tiles.find_places((10.0, 10.0), 0.1)) == 4
    part, whole = tiles.mesh((1.0, 1.0), 2.0), tiles.mesh()
    assert part.bounds[1][0] == 10.0
    assert len(whole.faces) > 3 * len(part.faces)
    with pytest.raises(ReconstructionError, match=r"no tile within 1 m of \[100.0, 0.0\]; there are"):
        tiles.mesh((100.0, 0.0), 1.0)


def test_the_seams_have_no_cracks(tiles):
    """Both sides are the same vertex by vertex: but at the rim of the scan, no edge on a seam has a single face."""
    mesh = tiles.mesh()
    edges, counts = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)
    ends = mesh.vertices[edges[counts == 1]][:, :, :2]
    ends = ends[((ends > 1.0) & (ends < EXTENT - 1.0)).all(axis=(1, 2))]
    on_seam = (np.abs(ends - CONFIG.tile) < 1e-6).all(axis=1).any(axis=1)
    assert not on_seam.any()
    assert counts.max() == 2


def test_far_coordinates_give_the_same_surface(tiles, tmp_path):
    moved = reconstruct_tiles(make_points() + FAR, tmp_path / "far", CONFIG)
    assert np.array_equal(np.array(moved.offset) % 1.0, np.zeros(3))
    low = moved.mesh().bounds[0] + moved.offset - FAR
    assert np.allclose(low[:2], tiles.mesh().bounds[0][:2], atol=0.3)


def test_tiles_with_few_points_are_counted(tmp_path, caplog):
    points = np.concatenate([make_points(), [[35.0, 5.0, 0.0]] * 40])
    with caplog.at_level(logging.WARNING):
        tiles = reconstruct_tiles(points, tmp_path / "tiles", CONFIG, is_raw=True)
    assert (3, 0) not in tiles.places
    assert "40 of the points lie in tiles with too few for a surface" in caplog.text
    with pytest.raises(ReconstructionError, match="no tile has a surface: 40 points are too few"):
        reconstruct_tiles(points[-40:], tmp_path / "none", CONFIG, is_raw=True)


def test_a_folder_of_others_is_refused_and_one_of_tiles_replaced(tiles, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other/notes.txt").write_text("mine")
    with pytest.raises(ReconstructionError, match="is not empty and holds no tiles"):
        reconstruct_tiles(make_points(), tmp_path / "other", CONFIG)
    (tmp_path / "other" / INDEX).write_text("{}")
    with pytest.raises(ReconstructionError, match="is damaged or of another program"):
        reconstruct_tiles(make_points(), tmp_path / "other", CONFIG)
    (tmp_path / "other" / INDEX).write_text('{"format": 1, "complete": true, "tiles": []}')
    (tmp_path / "other/tile_7_7.npz").write_text("old")
    again = reconstruct_tiles(make_points(), tmp_path / "other", CONFIG)
    assert set(read_all(again.folder)) == {*read_all(tiles.folder), "notes.txt"}
    wanted = read_all(tiles.folder)
    assert all(content == wanted[name] for name, content in read_all(again.folder).items() if name in wanted)


def test_a_reconstruction_that_did_not_end_is_no_surface(tmp_path, monkeypatch):
    def die(work, jobs):
        raise KeyboardInterrupt

    monkeypatch.setattr(tiling, "run_in_processes", lambda workers: die)
    with pytest.raises(KeyboardInterrupt):
        reconstruct_tiles(make_points(), tmp_path / "tiles", CONFIG)
    with pytest.raises(ReconstructionError, match="did not end; start it again"):
        TiledSurface.load(tmp_path / "tiles")
    with pytest.raises(ReconstructionError, match="no index of tiles"):
        TiledSurface.load(tmp_path)


@pytest.mark.parametrize("change", [{"tiles": [{"place": [10**20, 0]}]}, {"tile": 10**400}])
def test_an_index_beyond_all_places_is_refused(tmp_path, change):
    index = {"format": 1, "complete": True, "tiles": [], "offset": [0, 0, 0], "tile": 1.0}
    (tmp_path / INDEX).write_text(json.dumps(index | change))
    with pytest.raises(ReconstructionError, match="no index of tiles"):
        TiledSurface.load(tmp_path)


@pytest.mark.parametrize("name", ["tile_0_0.npz", INDEX])
def test_damaged_files_are_named(tiles, tmp_path, name):
    import shutil

    folder = shutil.copytree(tiles.folder, tmp_path / "tiles")
    (folder / name).write_bytes(b"nonsense")
    with pytest.raises(ReconstructionError, match=name.replace(".", r"\.")):
        TiledSurface.load(folder).mesh()


@pytest.mark.slow
def test_workers_give_the_same_files(tiles, tmp_path):
    again = reconstruct_tiles(make_points(), tmp_path / "tiles", CONFIG, workers=2)
    assert read_all(again.folder) == read_all(tiles.folder)


@pytest.mark.slow
def test_processes_answer_in_order_and_their_end_is_told(tmp_path):
    (tmp_path / "a.f4").write_bytes(np.zeros((5, 3), np.float32).tobytes())
    job = {"points": str(tmp_path / "a.f4"), "columns": 3, "is_raw": True}
    jobs = [job | {"place": [i, 0], "config": {"tile": 10.0}} for i in range(5)]
    here = list(run_here(reconstruct_tile, jobs))
    assert [report["place"] for report in here] == [[i, 0] for i in range(5)]
    assert here[0]["problem"] == "5 points are too few"
    assert list(run_in_processes(2)(reconstruct_tile, jobs)) == here
    with pytest.raises(ReconstructionError, match="a worker died on tile"):
        list(run_in_processes(2)(reconstruct_tile, [{"place": [0, 0]}, {"place": [1, 0]}]))
    with pytest.raises(ReconstructionError, match="workers is 0"):
        run_in_processes(0)


@pytest.mark.slow
def test_tiles_look_to_where_they_were_seen_from(tmp_path):
    points = make_points(6000)
    np.save(tmp_path / "points.npy", points + FAR)
    below = np.array([[5.0, 5.0, -30.0], [15.0, 15.0, -30.0]]) + FAR
    seen = reconstruct_tiles(tmp_path / "points.npy", tmp_path / "seen", CONFIG, viewpoints=below)
    assert (seen.mesh().face_normals[:, 2] < 0).mean() > 0.99
    with pytest.raises(ScanError, match="viewpoints must be finite"):
        reconstruct_tiles(tmp_path / "points.npy", tmp_path / "bad", CONFIG, viewpoints=[0.0, np.nan, 1.0])


COARSE = rc.TilesConfig(tile=10.0)


def make_field(num: int = 6000) -> rc.Cloud:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(0, 20, num), rng.uniform(0, 10, num), rng.normal(0, 0.01, num)])
    return rc.Cloud(points, np.round(255 * paint(points)).astype(np.uint8))


def paint(places):
    return np.stack([places[:, 0] / 20, 0.5 + 0 * places[:, 0], 1 - places[:, 1] / 10], axis=1).clip(0, 1)


@pytest.mark.slow
def test_tiles_have_the_colors_of_their_points(tmp_path):
    cloud = make_field()
    tiled = rc.reconstruct_tiles(cloud, tmp_path / "colored", COARSE)
    mesh = tiled.mesh()
    colors = find_vertex_colors(mesh)
    assert colors is not None
    assert np.sqrt(np.mean((colors / 255 - paint(np.asarray(mesh.vertices))) ** 2)) < 0.02
    plain = rc.reconstruct_tiles(cloud.points, tmp_path / "plain", COARSE).mesh()
    assert find_vertex_colors(plain) is None
    assert np.array_equal(plain.vertices, mesh.vertices)


def test_files_of_points_bring_their_colors(tmp_path):
    cloud = make_field()
    rows = np.column_stack([cloud.points, cloud.colors])
    np.savetxt(tmp_path / "a.xyz", rows, fmt=["%.4f"] * 3 + ["%d"] * 3)
    mesh = rc.reconstruct_tiles(tmp_path / "a.xyz", tmp_path / "tiles", COARSE).mesh()
    assert find_vertex_colors(mesh) is not None


def test_damaged_colors_are_refused(tmp_path):
    path = tmp_path / "tile_0_0.npz"
    np.savez(path, vertices=np.zeros((3, 3)), faces=np.array([[0, 1, 2]]), colors=np.zeros((2, 3), np.uint8))
    with pytest.raises(rc.ReconstructionError, match="colors are uint8 of"):
        read_surface(path)
