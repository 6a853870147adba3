"""Tracks on any spec: they drive, turn and climb as stated."""

from typing import Any

import mujoco
import numpy as np
import pytest

import symbrion_gym as sg
from symbrion_gym._src.robot.belts import (
    BELT_MODELS,
    Contacts,
    Tracks,
    compute_load_gain,
    compute_sliding_rate,
)

STEPS = 1000


def make_rover(friction: float = 0.7, slope: float = 0.0, **sizes: Any) -> tuple[mujoco.MjSpec, Tracks]:
    """Return a rover of 4 kg on a plane that rises ahead by a slope [rad]."""
    spec = mujoco.MjSpec()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [-9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope)]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1], friction=[0.01, 0.005, 0.0001])
    body = spec.worldbody.add_body(name="rover", pos=[0, 0, 0.052])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.17, 0.1, 0.03], mass=3)
    return spec, sg.add_tracks(spec, "rover", friction=friction, **sizes)


def drive(model: mujoco.MjModel, tracks: Tracks, left: float, right: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean velocity of the body [m/s] and its mean rates [rad/s], after it has settled."""
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 200)
    tracks.drive(model, data, left, right)
    mujoco.mj_step(model, data, 300)
    start, rates = data.qpos[:3].copy(), []
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        rates.append(data.qvel[3:6].copy())
    return (data.qpos[:3] - start) / (STEPS * model.opt.timestep), np.mean(rates, axis=0)


@pytest.mark.parametrize("model", BELT_MODELS)
@pytest.mark.parametrize("speed", [0.2, -0.1])
def test_it_drives_straight_at_the_commanded_speed(model: str, speed: float) -> None:
    spec, tracks = make_rover(model=model)
    velocity, rates = drive(spec.compile(), tracks, speed, speed)
    np.testing.assert_allclose(velocity, [speed, 0.0, 0.0], atol=0.02 * abs(speed))
    assert np.abs(rates).max() < 0.01


def test_it_stands_still_until_it_is_driven_and_on_its_back_drives_the_other_way() -> None:
    spec, tracks = make_rover()
    velocity, _ = drive(spec.compile(), tracks, 0.0, 0.0)
    assert np.abs(velocity).max() < 1e-4
    spec.body("rover").quat = [0, 1, 0, 0]
    velocity, _ = drive(spec.compile(), tracks, 0.2, 0.2)
    np.testing.assert_allclose(velocity, [-0.2, 0.0, 0.0], atol=4e-3)


@pytest.mark.parametrize("model", BELT_MODELS)
@pytest.mark.parametrize(("left", "right"), [(-0.2, 0.2), (0.1, 0.2)])
def test_it_turns_as_stated_and_on_the_spot(model: str, left: float, right: float) -> None:
    spec, tracks = make_rover(model=model)
    velocity, rates = drive(spec.compile(), tracks, left, right)
    stated = tracks.turning_rate(left, right)
    assert rates[2] == pytest.approx(stated, rel=0.1 if model == "belts" else 0.3)
    if left == -right:
        assert np.linalg.norm(velocity[:2]) < 0.01


@pytest.mark.parametrize("model", BELT_MODELS)
def test_it_climbs_up_to_the_angle_of_friction(model: str) -> None:
    friction = 0.6
    for margin, climbs in ((-1.0, True), (1.0, False)):
        slope = np.arctan(friction) + np.radians(margin)
        spec, tracks = make_rover(friction, slope, model=model, position=(0.0, 0.0, 0.0))
        velocity, _ = drive(spec.compile(), tracks, 0.1, 0.1)
        assert (velocity[0] > 0.09) == climbs
        assert (velocity[0] < -0.1) == (not climbs)


@pytest.mark.parametrize(("distance", "speed"), [(0.13, 0.2), (0.3, 0.2), (0.2, 0.05)])
def test_four_tracks_turn_as_stated(distance: float, speed: float) -> None:
    spec, front = make_rover(length=0.25, position=(distance, 0.0, 0.0))
    rear = sg.add_tracks(spec, "rover", length=0.25, position=(-distance, 0.0, 0.0), prefix="rear_")
    model = spec.compile()
    data = mujoco.MjData(model)
    for tracks in (front, rear):
        tracks.drive(model, data, -speed, speed)
    mujoco.mj_step(model, data, STEPS)
    stated = front.turning_rate(-speed, speed, others=[rear])
    assert stated == pytest.approx(rear.turning_rate(-speed, speed, others=[front]), rel=1e-3)
    assert data.qvel[5] == pytest.approx(stated, rel=0.1)
    assert stated < 0.5 * front.turning_rate(-speed, speed)


@pytest.mark.parametrize("model", BELT_MODELS)
def test_it_survives_xml_and_attaching(model: str) -> None:
    spec, tracks = make_rover(model=model)
    wanted, _ = drive(spec.compile(), tracks, 0.1, 0.2)
    again, _ = drive(mujoco.MjModel.from_xml_string(spec.to_xml()), tracks, 0.1, 0.2)
    np.testing.assert_allclose(again, wanted, atol=2e-3)
    robot = mujoco.MjSpec()
    body = robot.worldbody.add_body(name="rover", pos=[0, 0, 0.052])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.17, 0.1, 0.03], mass=3)
    tracks = sg.add_tracks(robot, body, model=model)
    world = mujoco.MjSpec()
    world.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    world.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    world.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1])
    world.attach(robot, prefix="r/", frame=world.worldbody.add_frame())
    velocity, _ = drive(world.compile(), tracks.renamed("r/"), 0.2, 0.2)
    np.testing.assert_allclose(velocity, [0.2, 0.0, 0.0], atol=4e-3)
    with pytest.raises(sg.OrganismError, match=r"no 'belt_left.*renamed"):
        tracks.drive(world.compile(), mujoco.MjData(world.compile()), 0.1, 0.1)


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ({"length": 0.0}, "length must be above 0"),
        ({"length": 0.1}, "raise length"),
        ({"gauge": 0.05}, "raise gauge"),
        ({"friction": float("nan")}, "friction"),
        ({"mass": -1.0}, "mass"),
        ({"model": "chain"}, "there are: belts, wheels"),
        ({"num_wheels": 1}, "2 or more"),
        ({"position": (0.0, float("inf"), 0.0)}, "position"),
        ({"size": 1.0}, "tracks: there is no 'size'; there are: length"),
        ({"prefix": ""}, "give another prefix"),
    ],
)
def test_bad_values_are_refused_by_name(sizes: dict[str, Any], message: str) -> None:
    spec, _ = make_rover()
    with pytest.raises(sg.OrganismError, match=message):
        sg.add_tracks(spec, "rover", None, **{"prefix": "b_"} | sizes)


def test_other_bodies_and_speeds_are_refused() -> None:
    spec, tracks = make_rover()
    with pytest.raises(sg.OrganismError, match=r"no body 'robot'; there are: .*'rover'"):
        sg.add_tracks(spec, "robot", prefix="b_")
    model = spec.compile()
    with pytest.raises(sg.OrganismError, match="left belt is nan"):
        tracks.drive(model, mujoco.MjData(model), float("nan"), 0.0)


HALF, REACH, SPEED = 0.15, 0.1, 0.2  # Turning by the law of MuJoCo's contacts: cases known by hand


def make_contacts(stations: tuple[float, ...], edges: tuple[float, ...] = (HALF,)) -> Contacts:
    """Return contacts at stations along, and at edges on both sides."""
    sides = [*edges, *(-edge for edge in edges)]
    points = np.array([(x, y) for x in stations for y in sides])
    belts = np.where(points[:, 1] > 0, -SPEED, SPEED)
    return Contacts(points, belts, np.zeros(len(points), int), np.zeros((1, 2)), np.ones(1))


@pytest.mark.parametrize("gain", [0.0, 50.0])
def test_four_corners_bear_the_same_whatever_the_gain(gain: float) -> None:
    found = compute_sliding_rate(make_contacts((-REACH, REACH)), gain)
    assert found == pytest.approx(SPEED * HALF / (HALF**2 + REACH**2), rel=1e-4)


def test_without_gain_loads_are_even_and_with_it_the_fastest_bear_all() -> None:
    stations = (-REACH, 0.0, REACH)
    # Moments about the middle: two corners at a reach r pull with cosine of their slip, the middle with all.
    rate = compute_sliding_rate(make_contacts(stations), 0.0)
    slips = np.hypot(SPEED - rate * HALF, rate * REACH)
    corner = ((SPEED - rate * HALF) * HALF - rate * REACH**2) / slips
    assert 2 * corner + HALF == pytest.approx(0.0, abs=1e-6)
    corners = compute_sliding_rate(make_contacts((-REACH, REACH)), 0.0)
    assert compute_sliding_rate(make_contacts(stations), 1e3) == pytest.approx(corners, rel=1e-3)


def test_still_belts_and_equal_belts_do_not_turn() -> None:
    contacts = make_contacts((-REACH, REACH))
    assert compute_sliding_rate(contacts._replace(belts=np.zeros(4)), 10.0) == 0.0
    assert compute_sliding_rate(contacts._replace(belts=np.full(4, SPEED)), 10.0) == pytest.approx(
        0.0, abs=1e-6
    )


def test_gain_by_hand() -> None:
    expected = 0.7 * (2 / (0.95 * 0.02)) * 9 / 9.81 / (1 + 0.49 / 10)
    assert compute_load_gain(0.7, impratio=10.0) == pytest.approx(expected)
    assert compute_load_gain(0.7, 10.0, time_constant=0.01) == pytest.approx(2 * expected)
