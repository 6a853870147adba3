"""The rays of a lone Scout are those of its model's sites."""

import mujoco
import numpy as np

from symbrion_gym._src.robot.scout import find_scout_rays, make_scout
from symbrion_gym._src.robot.scout_constants import SIDES


def test_rays_begin_and_look_as_the_sites_of_the_model():
    model = make_scout().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [f"ir_{side}_{k}" for side in SIDES for k in range(2)] + [f"laser_{k}" for k in range(19)]
    sites = [next(i for i in range(model.nsite) if model.site(i).name.endswith(name)) for name in names]
    body = data.body(int(model.site_bodyid[sites[0]]))
    rotation = body.xmat.reshape(3, 3)
    rays = find_scout_rays()
    assert len(rays.origins) == len(sites)
    origins = (data.site_xpos[sites] - body.xpos) @ rotation
    directions = data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2] @ rotation
    np.testing.assert_allclose(origins, rays.origins, atol=1e-9)
    np.testing.assert_allclose(directions, rays.directions, atol=1e-9)
