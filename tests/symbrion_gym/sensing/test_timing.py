"""MuJoCo's own timers."""

import mujoco

from symbrion_gym._src.sensing.timing import timing

BALL = (
    "<mujoco><worldbody><geom type='plane' size='1 1 .1'/><body pos='0 0 .1'><freejoint/>"
    "<geom size='.1'/></body></worldbody></mujoco>"
)


def test_steps_are_counted_and_collisions_lie_inside():
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=10)
    with timing(data) as measured:
        mujoco.mj_step(model, data, nstep=50)
    assert measured.num_steps == 50
    assert measured.physics_us > measured.collision_us > 0.0
