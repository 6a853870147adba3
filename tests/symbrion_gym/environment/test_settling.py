"""A body of any shape comes to rest on the ground."""

import mujoco
import numpy as np
import pytest

from symbrion_gym._src.environment.laying import Settler, compute_depth

_BODY = """
<body name="trunk" pos="0 0 {height}">
  <freejoint name="root"/>
  <geom type="box" size="0.1 0.05 0.05" mass="3"/>
  <site name="module_0"/>
  <body name="leg" pos="0.2 0 0">
    <joint name="hinge" axis="0 1 0" pos="-0.1 0 0" range="-1.5 1.5" limited="true"/>
    <geom type="box" size="0.1 0.05 0.05" mass="1"/>
    <site name="module_1"/>
  </body>
</body>
"""


def make_settler(ground: str, height: float = 0.06) -> tuple[mujoco.MjModel, Settler]:
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><worldbody>{ground}{_BODY.format(height=height)}</worldbody></mujoco>'
    )
    sites = np.array([model.site(name).id for name in ("module_0", "module_1")])
    return model, Settler(model, sites, np.array([model.joint("hinge").dofadr[0]]), 0.05)


@pytest.mark.parametrize("height", [0.06, 0.03])
def test_on_a_plane_it_lies_flat_at_the_gap_and_what_is_in_the_ground_is_lifted(height) -> None:
    model, settler = make_settler('<geom type="plane" size="5 5 0.1"/>', height)
    depth = compute_depth(model, mujoco.MjData(model), model.qpos0.copy())
    assert depth == pytest.approx(max(0.05 - height, 0.0))
    qpos = settler.settle(model.qpos0.copy(), 0.002)
    np.testing.assert_allclose(qpos, [0, 0, 0.052, 1, 0, 0, 0, 0], atol=1e-5)


def test_over_an_edge_the_hinge_bends() -> None:
    """The trunk lies on a table, and the leg reaches down to the floor beside it."""
    table = '<geom type="box" size="0.5 0.5 0.05" pos="-0.445 0 0.05"/><geom type="plane" size="5 5 0.1"/>'
    model, settler = make_settler(table, 0.16)
    qpos = settler.settle(model.qpos0.copy(), 0.002)
    assert qpos[2] == pytest.approx(0.152, abs=1e-3)
    assert 0.2 < qpos[7] < 1.0
    assert abs(compute_depth(model, mujoco.MjData(model), qpos)) < 1e-9


def test_on_a_slope_it_tilts_and_does_not_slide() -> None:
    tilt = np.arctan(0.25)
    plane = f'<geom type="plane" size="5 5 0.1" euler="{tilt} 0 0"/>'
    model, settler = make_settler(plane, 0.07)
    qpos = settler.settle(model.qpos0.copy(), 0.002)
    assert 2 * np.arcsin(qpos[4]) == pytest.approx(tilt, abs=1e-3)
    np.testing.assert_allclose(qpos[:2], 0.0, atol=0.004)


def test_it_repeats_to_the_bit_and_leaves_the_model_alone() -> None:
    model, settler = make_settler('<geom type="box" size="1 1 0.1" euler="0.1 0.05 0"/>', 0.18)
    first, second = (settler.settle(model.qpos0.copy(), 0.002) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert (model.geom_margin == 0).all()


def test_what_hangs_over_an_abyss_does_not_fold_under() -> None:
    model, settler = make_settler('<geom type="box" size="0.5 0.5 0.05" pos="-0.445 0 0.05"/>', 0.16)
    qpos = settler.settle(model.qpos0.copy(), 0.002)
    assert 0.5 < qpos[7] < np.pi / 3 + 1e-6
