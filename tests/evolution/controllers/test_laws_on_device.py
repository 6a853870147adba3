"""Controllers compute with arrays of JAX what they compute with those of NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evolution._src.controllers.controller import CONTROLLERS, make_law
from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.world import find_organism

NUM = 5


@pytest.mark.slow
@pytest.mark.parametrize("law", CONTROLLERS)
@pytest.mark.parametrize(("body", "tracks"), [({"modules": 5}, 0), ({"organism": "cross"}, "skid")])
def test_actions_are_those_of_numpy(law, body, tracks):
    organism = find_organism(EnvironmentConfig(**body), 0.7)
    n = organism.num_modules
    controller = make_law(law, organism, 2 * n if tracks else 0)
    sizes = {"hinge_angle": len(organism.hinges), "track_odometry": 1, "goal_direction": 2}
    structure, first = {}, 0
    for name in controller.sensors:
        structure[name] = slice(first, first := first + sizes.get(name, n))
    rng = np.random.default_rng(0)
    genotypes = rng.normal(0.0, 0.4, (NUM, len(controller.parameters)))
    state = controller.begin(NUM)
    traced = jax.tree.map(jnp.asarray, state)
    act = jax.jit(lambda seen, genes, kept: controller.act(seen, genes, structure, kept))
    for _ in range(20):
        seen = rng.normal(0.0, 0.4, (NUM, first))
        wanted, state = controller.act(seen, genotypes, structure, state)
        found, traced = act(*map(jnp.float32, (seen, genotypes)), traced)
        assert isinstance(found, jax.Array)
        np.testing.assert_allclose(found, wanted, atol=2e-4)
