"""An arena of the tiles around a robot."""

import gymnasium as gym
import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from reconstruction._src.tiles.folder import claim_folder, name_tile, write_index, write_surface
from symbrion_gym._src.contact.kinds import HeightField


@pytest.fixture
def folder(tmp_path):
    """Four tiles of 4 m on a slope, far from the origin of the scan."""
    places = [(x, y) for x in (0, 1) for y in (0, 1)]
    claim_folder(tmp_path / "valley")
    for x, y in places:
        low = np.array([4.0 * x, 4.0 * y])
        plan = np.stack(np.meshgrid(*(np.linspace(v, v + 4, 9) for v in low)), axis=-1)
        mesh = HeightField(0.1 * plan[..., 0], low, low + 4).as_mesh()
        write_surface(
            tmp_path / "valley" / name_tile((x, y)), np.asarray(mesh.vertices), np.asarray(mesh.faces)
        )
    tiles = [{"place": list(place)} for place in places]
    write_index(
        tmp_path / "valley", {"complete": True, "tile": 4.0, "offset": [5e5, 4e6, 100.0], "tiles": tiles}
    )
    return tmp_path / "valley"


def test_the_tiles_near_a_place_become_an_arena(folder):
    arena = sg.load_tiles(folder, (1.0, 1.0), 1.5, cache=False)
    assert np.allclose(arena.surface.bounds[:, :2], [[0, 0], [4, 4]])
    assert arena.height(2.0, 3.0) == pytest.approx(0.2)
    assert arena.name == "valley"
    assert arena.provenance["offset"] == [5e5, 4e6, 100.0]
    assert getattr(arena, "offset", (5e5, 4e6, 100.0)) == (5e5, 4e6, 100.0)
    assert arena.quality.mean < 0.003


@pytest.mark.slow
def test_seams_inside_of_an_arena_are_closed(folder):
    arena = sg.load_tiles(folder, (4.0, 4.0), 1.0, kind="hfield", cache=False)
    assert np.allclose(arena.surface.bounds[:, :2], [[0, 0], [8, 8]])
    assert len(trimesh.graph.connected_components(arena.surface.edges)) == 1


def test_a_folder_of_tiles_is_an_arena_wherever_one_is_named(folder):
    arena = sg.load_arena(folder, center=(1.0, 1.0), radius=1.5, cache=False)
    assert np.allclose(arena.surface.bounds[:, :2], [[0, 0], [4, 4]])
    options = {"task": "reach", "start": (2.0, 2.0), "goal": (5.0, 4.0), "modules": 1}
    env = gym.make("symbrion_gym/SnakePit-v1", arena=str(folder), track_control="skid", **options)
    env.reset(seed=0)
    assert np.allclose(env.unwrapped.world.arena.surface.bounds[:, :2], [[0, 0], [8, 8]])


def test_a_place_without_tiles_and_a_folder_without_are_refused(folder, tmp_path):
    with pytest.raises(sg.ArenaError, match=r"no tile within 2 m of \[50.0, 0.0\]"):
        sg.load_tiles(folder, (50.0, 0.0), 2.0)
    with pytest.raises(sg.ArenaError, match="no index of tiles"):
        sg.load_tiles(tmp_path)
