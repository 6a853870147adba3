"""Simulations of one batch in arenas of different lengths: each as if it were alone."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from side_by_side import assert_equal_ticks

from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.randomization import LayoutError

STRETCHES = (0.975, 1.0, 1.025)
OPTIONS = {"arena": "gsrm", "modules": 4, "start": "pit", "stuck_time": 2.0}
RESET = {"friction": [0.5, 0.6, 0.7, 0.8], "yaw": (-0.1, 0.1)}


@pytest.mark.parametrize("more", [{}, {"track_control": "modules"}])
def test_each_simulation_has_its_own_arena_to_the_bit(more):
    vector = OrganismVectorEnv(
        4, num_threads=2, autoreset_mode="Disabled", stretches=STRETCHES, **OPTIONS, **more
    )
    rng = np.random.default_rng(0)
    for seed, stretches in ((3, [1.0, 0.975, 1.025, 1.0]), (8, [0.975, 1.0, 1.025, 1.025])):
        singles = [OrganismEnv(stretch=stretch, **OPTIONS, **more) for stretch in stretches]
        observation, info = vector.reset(seed=seed, options={**RESET, "stretch": stretches})
        for i, env in enumerate(singles):
            one, one_info = env.reset(seed=seed + i, options={**RESET, "friction": RESET["friction"][i]})
            np.testing.assert_array_equal(observation[i], one)
            assert info["x_position"][i] == one_info["x_position"]
        assert_equal_ticks(vector, singles, 120, rng)


def test_many_static_pieces_are_left_out_of_steps_to_the_bit():
    truth = load_arena("truth")
    boxes = [trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation((0.2 * i, 5.0, 0.0)) for i in range(300)]
    options = {"modules": 4, "arena": replace(truth, pieces=[*truth.pieces, *boxes])}
    vector, one = (
        OrganismVectorEnv(2, num_threads=2, autoreset_mode="Disabled", **options),
        OrganismEnv(**options),
    )
    all_steps, _ = OrganismEnv(**{**options, "arena": truth}), vector.reset(seed=[0, 0])
    for env in (one, all_steps):
        env.reset(seed=0)
    far = one.model.geom(f"arena_piece_{len(truth.pieces) + 299}").id
    one.data.geom_xpos[far] += 9.0
    moved = one.data.geom_xpos[far].copy()
    assert_equal_ticks(vector, [one, all_steps], 40, np.random.default_rng(0))
    np.testing.assert_array_equal(one.data.geom_xpos[far], moved)  # no step has put it back


def _add_odd_piece(arena):
    """Return the arena with a piece that is a box only when the arena is stretched by the first factor."""
    box = trimesh.creation.box((0.3, 1.0, 0.3))
    box.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 4, [0, 1, 0], [0, 0, 0]))
    box.apply_translation([2.4, 0.0, 0.0])
    box.vertices[:, 0] /= STRETCHES[0]
    return replace(arena, pieces=[*arena.pieces, box])


def test_what_cannot_be_is_refused():
    vector = OrganismVectorEnv(2, modules=3, arena="gsrm", stretches=STRETCHES)
    with pytest.raises(ValueError, match=r"stretch must be one of \(0.975, 1.0, 1.025\), got 1.1"):
        vector.reset(options={"stretch": 1.1})
    with pytest.raises(LayoutError, match=r"stretched by 0.975 and 1 .* of its own"):
        OrganismVectorEnv(2, modules=3, arena=_add_odd_piece(load_arena("truth")), stretches=STRETCHES)
    with pytest.raises(ValueError, match="images of several stretches"):
        OrganismVectorEnv(2, arena="gsrm", stretches=STRETCHES, render_mode="rgb_array")
