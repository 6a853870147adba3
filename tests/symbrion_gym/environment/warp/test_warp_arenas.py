"""Different arenas in one batch of Warp, on its CPU device: each as if it were alone, to the bit."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from gymnasium.vector import AutoresetMode

import symbrion_gym as sg
from symbrion_gym._src.arenas.placed_objects import PlacedObject
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.errors import OptionError

pytest.importorskip("mujoco_warp", reason="needs the extra gpu")
pytestmark = pytest.mark.long

OPTIONS = {"modules": 3, "start": "pit", "duration": 0.5, "noise": 1.0, "backend": "warp", "device": "cpu"}
COUNT = 7


@pytest.fixture(scope="module")
def arenas():
    """A course of boxes; a scanned one; one of meshes, boxes with a tip below, with a friction patch."""
    outline = ((-9.0, -1.0), (0.0, -1.0), (0.0, 1.0), (-9.0, 1.0))
    slippery = sg.FrictionMap((sg.FrictionPatch(0.2, (outline,)),))
    narrow = sg.Arena.from_course(sg.Course(pit=0.3), "slippery")
    tips = [each.vertices.mean(axis=0) - (0.0, 0.0, np.ptp(each.vertices[:, 2])) for each in narrow.pieces]
    corners = [np.vstack([each.vertices, tip]) for each, tip in zip(narrow.pieces, tips, strict=True)]
    pieces = [trimesh.convex.convex_hull(each) for each in corners]
    return ["truth", "gsrm", replace(narrow, pieces=pieces, friction_map=slippery)]


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_each_arena_is_as_if_it_were_alone(arenas, mode):
    options, rng = {**OPTIONS, "autoreset_mode": mode}, np.random.default_rng(0)
    many = make_vector_env(COUNT, arenas=arenas, **options)
    rows = [slice(i, None, len(arenas)) for i in range(len(arenas))]
    sizes = [len(range(COUNT)[own]) for own in rows]
    alone = [make_vector_env(size, arena=arena, **options) for arena, size in zip(arenas, sizes, strict=True)]

    def compare(call):
        whole = call(many, slice(None))
        for envs, own in zip(alone, rows, strict=True):
            for one, other in zip(whole[:-1], call(envs, own)[:-1], strict=True):
                np.testing.assert_array_equal(one[own], other)
        return whole

    friction = np.linspace(0.4, 0.9, COUNT)
    compare(lambda envs, own: envs.reset(seed=[*range(COUNT)][own], options={"friction": friction[own]}))
    ended = np.zeros(COUNT, dtype=bool)
    for actions in rng.uniform(-1.0, 1.0, (4, COUNT, 2)).repeat(10, axis=0):
        *_, terminated, truncated, _ = compare(lambda envs, own, each=actions: envs.step(each[own]))
        ended |= terminated | truncated
    assert ended.all(), "episodes end, and begin again where the mode says so"
    places = many.parts[0].batch.engine.bind("qpos")[:, :7]
    assert min(np.abs(places[0] - places[i]).max() for i in (1, 2)) > 1e-3, "the arenas do differ"


def test_arenas_whose_states_differ_in_size_are_refused_by_name():
    station = PlacedObject("station", np.zeros(3), np.eye(3), trimesh.creation.box((0.3, 0.3, 0.3)))
    marked = replace(sg.load_arena("truth"), objects=(station,), name="marked")
    with pytest.raises(OptionError, match="'truth' and 'marked' differ in the number of sites"):
        make_vector_env(2, arenas=["truth", marked], **OPTIONS)
    with pytest.raises(OptionError, match="array='jax' holds one arena"):
        make_vector_env(2, arenas=["truth", "gsrm"], array="jax", **OPTIONS)
